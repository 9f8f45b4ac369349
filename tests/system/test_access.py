"""The program with logins: over TLS, over a unix socket, and its first account."""

import ssl
from collections.abc import Callable
from pathlib import Path

import httpx2
import pytest
from rigs.command_line import padwatch

from .conftest import PATIENCE_S, Start

Write = Callable[..., Path]

PASSWORD = "the river is high in may"  # noqa: S105


@pytest.fixture
def tls(certificate: tuple[Path, Path]) -> str:
    """The table of a server that has this certificate."""
    return f'[service.tls]\ncertificate = "{certificate[0]}"\nkey = "{certificate[1]}"\n'


async def test_over_tls_a_trusted_service_lets_the_first_account_be_made_with_what_it_prints(
    start: Start, write_plant: Write, tmp_path: Path, certificate: tuple[Path, Path], tls: str
) -> None:
    plant = write_plant(tmp_path, tables=f"{tls}[access]\nlogin = true\n")
    service = await start("run", str(plant), "--port", "0")
    url = await service.wait_for_url()
    token = await service.wait_for_token()
    trusted = ssl.create_default_context(cafile=certificate[0])
    async with httpx2.AsyncClient(
        base_url=url, verify=trusted, trust_env=False, timeout=PATIENCE_S
    ) as client:
        closed = await client.get("/api/v1/units")
        made, login, cookie = await first_account(client, token)
        seen = await client.get("/api/v1/units", headers={"Cookie": cookie})
        open_ = await client.get("/livez")
    async with httpx2.AsyncClient(trust_env=False, timeout=PATIENCE_S) as plain:
        with pytest.raises(httpx2.TransportError):
            await plain.get(url.replace("https", "http") + "/livez")

    assert url.startswith("https://127.0.0.1:")
    answers = (closed, made, login, seen, open_)
    assert [answer.status_code for answer in answers] == [401, 201, 201, 200, 200]
    assert open_.headers["strict-transport-security"]
    assert await service.end() == 0
    assert token not in service.errors


async def test_on_a_socket_everybody_logs_in_and_the_proxy_says_who_it_speaks_for(
    start: Start, write_plant: Write, tmp_path: Path
) -> None:
    path = tmp_path / "http.sock"
    service = await start("run", str(write_plant(tmp_path, service=f'socket = "{path}"\n')))
    assert await service.wait_for_url() == f"unix:{path}"
    assert path.stat().st_mode & 0o777 == 0o660
    token = await service.wait_for_token()
    transport = httpx2.AsyncHTTPTransport(uds=str(path))
    headers = {"X-Forwarded-For": "127.0.0.1, 192.0.2.7", "X-Forwarded-Proto": "https"}
    async with httpx2.AsyncClient(
        transport=transport, base_url="http://localhost", headers=headers, timeout=PATIENCE_S
    ) as client:
        closed = await client.get("/api/v1/units")
        made, login, cookie = await first_account(client, token, Origin="https://localhost")
        told = (await client.get("/api/v1/audit", headers={"Cookie": cookie})).json()

    assert [r.status_code for r in (closed, made, login)] == [401, 201, 201]
    assert told["entries"][0]["peer"] == "192.0.2.7"
    assert await service.end() == 0
    assert not path.exists()


def test_for_others_nothing_starts_without_an_account(
    write_plant: Write, tmp_path: Path, tls: str
) -> None:
    plant = write_plant(tmp_path, tables=tls)
    text = plant.read_text(encoding="utf-8").replace('"127.0.0.1"', '"0.0.0.0"', 1)
    plant.write_text(text, encoding="utf-8")

    found = padwatch("run", plant, "--port", "0")

    assert found.exit_code == 2
    assert "an account" in found.stderr


async def first_account(
    client: httpx2.AsyncClient, token: str, **headers: str
) -> tuple[httpx2.Response, httpx2.Response, str]:
    """Make an account and log in; the answers, and the cookie of the session."""
    account = {"name": "anna", "password": PASSWORD}
    made = await client.post("/api/v1/set-up", json={"token": token} | account)
    login = await client.post("/api/v1/session", json=account, headers=headers)
    return made, login, login.headers["set-cookie"].partition(";")[0]
