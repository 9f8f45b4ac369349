"""Names of receivers, looked up by name servers that may never answer."""

import socket
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from acquisition.delivery.network import NameLookUp
from service.delivery.network import Timeouts, Trust
from service.delivery.outcome import Failed
from service.delivery.webhook import Webhook, WebhookTarget


class NameServer:
    """What the system's look-up does, until it is told to go on."""

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.may_answer = threading.Event()

    def getaddrinfo(self, host: str, port: int, **_: object) -> list[Any]:
        self.asked.append(host)
        self.may_answer.wait(60)
        if host == "desk.example":
            return [(socket.AF_INET, socket.SOCK_STREAM, 6, "", ("127.0.0.1", port))] * 2
        raise socket.gaierror(-2, "Name or service not known")


@pytest.fixture
def names(monkeypatch: pytest.MonkeyPatch) -> Iterator[NameServer]:
    server = NameServer()
    monkeypatch.setattr("acquisition.delivery.network.socket.getaddrinfo", server.getaddrinfo)
    yield server
    server.may_answer.set()


async def test_a_silent_name_server_costs_an_attempt_and_one_thread_however_often_it_is_asked(
    names: NameServer, room: Any
) -> None:
    soon = Timeouts(connect_s=0.05, answer_s=1.0, total_s=1.0)
    webhook = Webhook(WebhookTarget("http://desk.example/", timeouts=soon), Trust(), room.clock)

    outcomes = [await webhook.carry({"id": "1"}, "{}") for _ in range(5)]

    assert outcomes == [Failed("no answer in time")] * 5
    assert await NameLookUp("::1", 443).addresses() == ["::1"]
    assert names.asked == ["desk.example"]
    names.may_answer.set()
    look_up = NameLookUp("desk.example", 443)
    assert [await look_up.addresses() for _ in range(2)] == [["127.0.0.1"]] * 2
    assert names.asked == ["desk.example"] * 3


async def test_what_cannot_be_looked_up_or_trusted_is_said(
    names: NameServer, room: Any, tmp_path: Any
) -> None:
    names.may_answer.set()
    webhook = Webhook(WebhookTarget("https://no.example/"), Trust(), room.clock)
    assert await webhook.carry({"id": "1"}, "{}") == Failed("Name or service not known")

    webhook = Webhook(WebhookTarget("https://127.0.0.1:1/"), Trust(tmp_path / "ca.pem"), room.clock)
    outcome = await webhook.carry({"id": "1"}, "{}")
    assert isinstance(outcome, Failed)
    assert f"ca_file {tmp_path / 'ca.pem'}" in outcome.answer


async def test_a_message_goes_to_the_name_it_is_meant_for(names: NameServer, room: Any) -> None:
    names.may_answer.set()
    server = await room.web(room.answers("200 OK"))
    url = f"http://desk.example:{server.port}/alarms?x=1"

    await Webhook(WebhookTarget(url), Trust(), room.clock).carry({"id": "1"}, "{}")

    (request,) = server.requests
    assert request.headers["host"] == f"desk.example:{server.port}"
    assert request.line == "POST /alarms?x=1 HTTP/1.1"


async def test_nothing_is_told_to_a_server_whose_certificate_is_not_believed(
    room: Any, server_tls: Any, certificate: Any
) -> None:
    server = await room.web(room.answers("200 OK"), context=server_tls)
    target = WebhookTarget(server.url)

    refused = await Webhook(target, Trust(), room.clock).carry({"id": "1"}, "{}")
    assert isinstance(refused, Failed)
    assert "certificate verify failed" in refused.answer.lower()
    assert server.requests == []

    await Webhook(target, Trust(certificate), room.clock).carry({"id": "1"}, "{}")
    assert len(server.requests) == 1
