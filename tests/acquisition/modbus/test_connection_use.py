"""Connections: kept, closed after each reply or by the other end, or given other replies."""

import asyncio
import socket
import threading
from collections.abc import Iterator
from contextlib import suppress
from itertools import islice

import pytest
from rigs.hostile_modbus import HostileServer
from rigs.polled import CALIBRATION, Follower, device_of, map_of, take

from acquisition.errors import ConfigError, LinkError
from acquisition.modbus.cells import Cell
from acquisition.modbus.client import ModbusClient
from acquisition.modbus.connection import ReplyProtocol
from acquisition.modbus.identity import ExpectedIdentification
from acquisition.modbus.polled_source import PolledSettings, PolledSource
from acquisition.modbus.register_map import Signature
from acquisition.modbus.transport import LinkSettings, TcpTransport
from acquisition.simulated.devices.modbus_links import ModbusTcpServer
from acquisition.simulated.devices.ring_device import RingDevice

ACME = ExpectedIdentification(vendor="Acme")
SIGNED = map_of(signature=(Signature(cell=Cell(address=1), expected=42.0),))


async def and_closed(request, reply, writer) -> None:  # noqa: ARG001
    writer.write(reply)
    writer.close()


@pytest.fixture
async def plant(stepped_clock):
    """A device that closes each connection after one reply, and what builds sources for it."""
    device = device_of(SIGNED)
    device.identification = {0: b"Acme"}
    clock = Follower(stepped_clock, device)
    async with HostileServer(device) as server:
        server.lie = and_closed

        def source(keeps_connection: bool) -> PolledSource:
            transport = TcpTransport(host="127.0.0.1", port=server.port)
            settings = PolledSettings(
                transport=transport,
                timeout_s=5.0,
                keeps_connection=keeps_connection,
                identity=ACME,
            )
            return PolledSource(settings, SIGNED, ("wave",), CALIBRATION, clock)

        yield device, server, source


async def test_a_device_that_closes_after_each_reply_is_read_by_a_connection_for_each(plant):
    _, _, source = plant

    with pytest.raises(LinkError, match="closed the connection"):
        await take(source(keeps_connection=True), 1)
    blocks = await take(source(keeps_connection=False), 5)

    assert [b.first_index for b in blocks] == [0, 1, 2, 3, 4]
    assert [float(b.samples[0, 0]) for b in blocks] == [100.0, 101.0, 102.0, 103.0, 104.0]


async def test_between_replies_no_connection_is_held(plant):
    _, server, source = plant
    server.lie = None

    async with source(keeps_connection=False).connect() as stream:
        await anext(stream)
        while server.n_connected:
            await asyncio.sleep(0)
        assert (await anext(stream)).first_index == 1


@pytest.mark.parametrize("other", ["vendor", "signature"])
async def test_another_device_is_noticed_at_the_next_poll(plant, other: str):
    device, _, source = plant

    async with source(keeps_connection=False).connect() as stream:
        await anext(stream)
        if other == "vendor":
            device.identification = {0: b"Other"}
        else:
            device.image.put(Cell(address=1), 43)
        with pytest.raises(ConfigError, match=r"wrong device"):
            await anext(stream)


@pytest.mark.parametrize("done", ["a reply", "a connection"])
async def test_what_is_done_with_the_stop_does_not_undo_it(
    done, counting_feed, link_to, monkeypatch
):
    method = {"a reply": "data_received", "a connection": "connection_made"}[done]
    does = getattr(ReplyProtocol, method)

    def stop_and_do(self, given):
        stopped.cancel()
        does(self, given)

    async with ModbusTcpServer(RingDevice(counting_feed())) as server:
        link = link_to(server.port)
        if done == "a reply":
            monkeypatch.setattr(ReplyProtocol, method, stop_and_do)
            await link.open()
        monkeypatch.setattr(ReplyProtocol, method, stop_and_do)
        stopped = asyncio.create_task(link.read(0, 16) if done == "a reply" else link.open())
        await asyncio.wait([stopped], timeout=30)
        assert stopped.cancelled()
        link.close()


N_TRIES = 200


@pytest.fixture
def port() -> Iterator[int]:
    """In a thread of its own: closed before the client has written anything."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def hang_up() -> None:
            with suppress(OSError):
                while True:
                    server.accept()[0].close()

        thread = threading.Thread(target=hang_up)
        thread.start()
        yield server.getsockname()[1]
        server.shutdown(socket.SHUT_RDWR)
        thread.join()


async def test_it_is_a_lost_link_each_time_and_nothing_else(port: int) -> None:
    settings = LinkSettings(
        transport=TcpTransport(host="127.0.0.1", port=port),
        identity=ExpectedIdentification(vendor="any"),
    )
    for _ in range(N_TRIES):
        link = ModbusClient(settings)
        with pytest.raises(LinkError, match=r"closed the connection|reset by peer"):
            await link.open()
        link.close()


@pytest.mark.parametrize(
    ("code", "error"),
    [(1, ConfigError), (2, ConfigError), (3, ConfigError)]
    + [(code, LinkError) for code in (0, 4, 5, 6, 10, 11, 0xEE)],
)
async def test_an_exception_reply_says_whether_trying_again_helps(code, error, hostile, source_at):
    async def refuse(request, reply, writer):  # noqa: ARG001
        writer.write(request[:4] + b"\0\3" + request[6:7] + bytes([0x83, code]))

    hostile.lie = refuse
    with pytest.raises(error, match=f"exception {code} "):
        async with source_at(hostile.port).connect():
            pass


async def test_a_late_reply_that_a_gateway_passes_on_to_the_next_connection_is_nobodys(hostile):
    settings = LinkSettings(
        transport=TcpTransport(host="127.0.0.1", port=hostile.port), timeout_s=0.1
    )
    late = []

    async def keep(request, reply, writer):  # noqa: ARG001
        late.append(reply)

    async def pass_on(request, reply, writer):  # noqa: ARG001
        writer.write(late[0])

    link = ModbusClient(settings)
    for lie, error in ((keep, LinkError), (pass_on, LinkError)):
        hostile.lie = lie
        await link.open()
        with pytest.raises(error):
            await link.read(len(late), 1)  # the same length, function and unit: only its id tells


async def test_transactions_are_numbered_on_from_connection_to_connection_and_never_zero(hostile):
    transport = TcpTransport(host="127.0.0.1", port=hostile.port)
    link = ModbusClient(LinkSettings(transport=transport))
    *_, last = islice(link._transactions, 64_998)
    for _ in range(2):
        await link.open()
        for _ in range(2):
            await link.read(0, 1)
        link.close()

    found = [int.from_bytes(request[:2], "big") for request in hostile.requests]
    assert (last, found) == (64_998, [64_999, 65_000, 1, 2])
