"""`padwatch demo`, what a service manager hears, and the program with logins."""

import asyncio
import os
import signal
import socket
import ssl
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import httpx2
import pytest
from rigs.command_line import padwatch

from .conftest import PATIENCE_S, Program, Start


def all_are(state: str) -> Callable[[Any], bool]:
    return lambda units: all(unit["source"]["state"] == state for unit in units)


@pytest.fixture
async def demo(start: Start, tmp_path: Path) -> AsyncIterator[Program]:
    """The demonstration without a past, ready to answer."""
    before = os.umask(0o022)  # as on most computers
    program = await start("demo", "--plain", "--port", "0", "--data-folder", str(tmp_path / "data"))
    await program.wait_for_url()
    yield program
    os.umask(before)


async def test_the_demo_ends_with_ctrl_c_in_order_and_takes_its_children_along(
    demo, tmp_path, daq_of, serving_of, gone
):
    daq, serving = daq_of(demo.pid), serving_of(demo.pid)
    while not list((tmp_path / "data").rglob("configurations")):  # kept by a task of its own
        await asyncio.sleep(0.05)
    kept = {path.name: path.stat().st_mode & 0o077 for path in (tmp_path / "data").rglob("*")}

    assert await demo.end(signal.SIGINT) == 0
    await gone(daq)
    await gone(serving)

    assert "Traceback" not in demo.errors
    assert kept.keys() >= {"padwatch.sqlite3", "padwatch.sqlite3-wal", "configurations"}
    assert not any(kept.values()), "somebody else may look into it"


async def test_a_service_that_is_killed_leaves_no_process_behind(demo, daq_of, serving_of, gone):
    daq, serving = daq_of(demo.pid), serving_of(demo.pid)

    demo.kill()

    await gone(daq)
    await gone(serving)


@pytest.mark.long  # tests/browser/living/test_lost_link.py has the example
async def test_a_daq_that_is_killed_leaves_numbers_that_are_not_current(demo, daq_of):
    await demo.until("/api/v1/units", all_are("connected"))
    assert (await demo.get("/readyz"))["status"] == "ok"
    daq = daq_of(demo.pid)

    os.kill(daq, signal.SIGKILL)
    units = await demo.until("/api/v1/units", all_are("not_connected"))

    for unit in units:
        assert "127.0.0.1" in unit["source"]["reason"]
        latest = await demo.get(f"/api/v1/units/{unit['id']}/bearings/UJB/latest")
        assert latest["quality"] == {"level": "bad", "reason": "not_connected"}
        assert {r["value"] for r in latest["readings"].values()} == {None}
    assert (await demo.get("/readyz"))["status"] == "ok"
    assert await demo.end(signal.SIGTERM) == 0


STATUS = "STATUS=0 of 2 units connected"


class Manager:
    """Reads all that comes, at once: a full queue would make the program drop messages."""

    def __init__(self, listener: socket.socket) -> None:
        self.told: list[str] = []
        self._news = asyncio.Condition()
        self.listening = asyncio.create_task(self._listen(listener))

    async def until(self, condition: Callable[[list[str]], bool]) -> None:
        async with asyncio.timeout(240.0), self._news:
            await self._news.wait_for(lambda: condition(self.told))

    async def _listen(self, listener: socket.socket) -> None:
        while True:
            message = await asyncio.get_running_loop().sock_recv(listener, 4096)
            async with self._news:
                self.told.append(message.decode())
                self._news.notify_all()


@pytest.fixture
async def manager(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Manager]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(str(tmp_path / "notify"))
        listener.setblocking(False)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        monkeypatch.setenv("WATCHDOG_USEC", "200000")
        monkeypatch.delenv("WATCHDOG_PID", raising=False)
        manager = Manager(listener)
        yield manager
        manager.listening.cancel()
        await asyncio.wait([manager.listening])


@pytest.mark.long
async def test_the_service_manager_is_told_from_start_to_end(start, write_plant, tmp_path, manager):
    program = await start("run", str(write_plant(tmp_path)), "--port", "0")
    await program.wait_for_url()
    await manager.until(lambda told: f"READY=1\n{STATUS}" in told)
    await manager.until(lambda told: told.count(f"WATCHDOG=1\n{STATUS}") >= 5)
    checks = (await program.get("/readyz"))["checks"]
    assert await program.end() == 0
    await manager.until(lambda told: told[-1] == "STOPPING=1\nSTATUS=stopping")

    assert {said for name, said in checks.items() if name.startswith("loop ")} == {"alive"}


PASSWORD = "the river is high in may"  # noqa: S105


@pytest.fixture
def tls(certificate: tuple[Path, Path]) -> str:
    """The table of a server that has this certificate."""
    return f'[service.tls]\ncertificate = "{certificate[0]}"\nkey = "{certificate[1]}"\n'


@pytest.mark.long
async def test_over_tls_a_trusted_service_lets_the_first_account_be_made_with_what_it_prints(
    start, write_plant, tmp_path, certificate, tls
):
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


@pytest.mark.long
async def test_on_a_socket_all_log_in_and_the_proxy_names_its_client(start, write_plant, tmp_path):
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


def test_for_others_nothing_starts_without_an_account(write_plant, tmp_path, tls):
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
