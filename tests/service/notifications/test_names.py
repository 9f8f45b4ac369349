"""Names of receivers, looked up by name servers."""

import socket
from typing import Any

import pytest

from service.notifications.channel import Failed
from service.notifications.webhook import Webhook


@pytest.fixture
def _name_server(monkeypatch: pytest.MonkeyPatch) -> None:
    """The system's look-up, which knows one name."""

    def getaddrinfo(host: str, port: int, **_: object) -> list[Any]:
        if host == "desk.example":
            return [(socket.AF_INET, socket.SOCK_STREAM, 6, "", ("127.0.0.1", port))] * 2
        raise socket.gaierror(-2, "Name or service not known")

    monkeypatch.setattr("acquisition.delivery.network.socket.getaddrinfo", getaddrinfo)


@pytest.mark.usefixtures("_name_server")
async def test_what_cannot_be_looked_up_or_trusted_is_said(room: Any, tmp_path: Any) -> None:
    webhook = Webhook(room.settings("https://no.example/"), room.clock)
    assert await webhook.send({"id": "1"}, "{}") == Failed("Name or service not known")

    webhook = Webhook(
        room.settings("https://127.0.0.1:1/", ca_file=str(tmp_path / "ca.pem")), room.clock
    )
    outcome = await webhook.send({"id": "1"}, "{}")
    assert isinstance(outcome, Failed)
    assert f"ca_file {tmp_path / 'ca.pem'}" in outcome.answer


@pytest.mark.usefixtures("_name_server")
async def test_a_message_goes_to_the_name_it_is_meant_for(room: Any) -> None:
    server = await room.web(room.answers("200 OK"))
    url = f"http://desk.example:{server.port}/alarms?x=1"

    await Webhook(room.settings(url), room.clock).send({"id": "1"}, "{}")

    (request,) = server.requests
    assert request.headers["host"] == f"desk.example:{server.port}"
    assert request.line == "POST /alarms?x=1 HTTP/1.1"


async def test_nothing_is_told_to_a_server_whose_certificate_is_not_believed(
    room: Any, server_tls: Any, certificate: Any
) -> None:
    server = await room.web(room.answers("200 OK"), context=server_tls)
    trusting = room.settings(server.url, ca_file=str(certificate[0]))

    refused = await Webhook(room.settings(server.url), room.clock).send({"id": "1"}, "{}")
    assert isinstance(refused, Failed)
    assert "certificate verify failed" in refused.answer.lower()
    assert server.requests == []

    await Webhook(trusting, room.clock).send({"id": "1"}, "{}")
    assert len(server.requests) == 1
