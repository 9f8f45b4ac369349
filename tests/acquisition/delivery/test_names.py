"""Names of devices, looked up by name servers that may be slow, wrong or dead."""

import asyncio
import socket
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from acquisition.delivery.network import HostAddresses
from acquisition.errors import LinkError
from acquisition.modbus.client import ModbusClient
from acquisition.modbus.transport import LinkSettings, TcpTransport


class NameServer:
    """What the system's look-up does."""

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.answer: list[str] | None = ["127.0.0.1"]
        self.answers = threading.Event()
        self.answers.set()

    def getaddrinfo(self, host: str, port: int, **_: object) -> list[Any]:
        self.asked.append(host)
        self.answers.wait(60)
        if self.answer is None:
            raise socket.gaierror(-3, "Temporary failure in name resolution")
        return [(socket.AF_INET, socket.SOCK_STREAM, 6, "", (at, port)) for at in self.answer]


@pytest.fixture
def names(monkeypatch: pytest.MonkeyPatch) -> Iterator[NameServer]:
    server = NameServer()
    monkeypatch.setattr("acquisition.delivery.network.socket.getaddrinfo", server.getaddrinfo)
    yield server
    server.answers.set()


async def test_what_was_known_last_is_used_while_no_name_server_answers(names):
    known = HostAddresses("daq.plant", 502)
    assert await known.within(5.0) == ["127.0.0.1"]

    names.answer = None
    assert await known.within(5.0) == ["127.0.0.1"]
    names.answers.clear()
    assert await known.within(0.01) == ["127.0.0.1"]
    names.answer = ["127.0.0.2"]
    names.answers.set()
    assert await known.within(5.0) == ["127.0.0.2"]
    assert names.asked == ["daq.plant"] * 3


async def test_a_name_that_was_never_known_is_a_lost_link_in_time_and_costs_one_thread(names):
    names.answers.clear()
    link = ModbusClient(LinkSettings(transport=TcpTransport(host="daq.plant"), timeout_s=0.02))
    for _ in range(5):
        with pytest.raises(
            LinkError, match=r"daq.plant:502: no name server answered within 0.02 s"
        ):
            await link.open()

    assert names.asked == ["daq.plant"]
    # the threads that others need, too, are all free
    n_threads = 64
    assert len(await asyncio.gather(*(asyncio.to_thread(int) for _ in range(n_threads)))) == 64


async def test_a_device_that_has_moved_is_found_at_its_other_address(names):
    server = await asyncio.start_server(lambda _, writer: writer.close(), "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    names.answer = ["127.0.0.77", "127.0.0.1"]
    link = ModbusClient(LinkSettings(transport=TcpTransport(host="daq.plant", port=port)))
    await link.open()
    link.close()
    server.close()
    await server.wait_closed()
