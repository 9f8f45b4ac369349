"""Connections: kept, closed after each reply or by the other end, with requests in flight."""

import asyncio
import socket
import struct
import threading
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import asynccontextmanager, suppress
from itertools import islice

import pytest
from rigs.hostile_modbus import HostileServer
from rigs.polled import CALIBRATION, Follower, device_of, map_of, take

from acquisition.errors import ConfigError, LinkError
from acquisition.modbus.cells import Cell
from acquisition.modbus.client import ModbusClient
from acquisition.modbus.connection import ReplyProtocol
from acquisition.modbus.polled_source import PolledSettings, PolledSource
from acquisition.modbus.register_map import Signature
from acquisition.modbus.requests import Span
from acquisition.modbus.transport import Identification, LinkSettings, TcpTransport
from acquisition.simulated.devices.modbus_links import ModbusTcpServer
from acquisition.simulated.devices.ring_device import RingDevice

ACME = Identification(vendor="Acme")
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
async def test_another_device_is_noticed_at_the_next_poll(plant, other):
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
async def test_work_done_with_the_stop_does_not_undo_it(done, counting_feed, link_to, monkeypatch):
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


async def test_it_is_a_lost_link_each_time_and_nothing_else(port):
    settings = LinkSettings(
        transport=TcpTransport(host="127.0.0.1", port=port),
        identity=Identification(vendor="any"),
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
    link = client(hostile.port, timeout_s=0.5)
    late = []

    async def keep(request, reply, writer):  # noqa: ARG001
        late.append(reply)

    async def pass_on(request, reply, writer):  # noqa: ARG001
        writer.write(late[0])

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


N_REGISTERS, STEP, IN_FLIGHT = 60, 10, 6
SPANS = [Span(at, STEP) for at in range(0, N_REGISTERS, STEP)]
RIGHT = b"".join(n.to_bytes(2, "big") for n in range(N_REGISTERS))

Frame = tuple[int, int, int]
"""Transaction, address and number of registers of a request."""


def answer(transaction: int, address: int, count: int) -> bytes:
    words = range(address, address + count)
    data = b"".join(n.to_bytes(2, "big") for n in words)
    return struct.pack(">HHHBBB", transaction, 0, 3 + len(data), 1, 3, len(data)) + data


def in_order(asked: Sequence[Frame]) -> list[bytes]:
    return [answer(*frame) for frame in asked]


def backwards(asked: Sequence[Frame]) -> list[bytes]:
    return in_order(asked)[::-1]


def twice(asked: Sequence[Frame]) -> list[bytes]:
    return [reply for reply in in_order(asked) for _ in range(2)]


def mixed(asked: Sequence[Frame]) -> list[bytes]:
    """The data of the next request under the number of this one."""
    moved = [*asked[1:], asked[0]]
    return [answer(a[0], b[1], b[2] - (a is asked[0])) for a, b in zip(asked, moved, strict=True)]


def joined(asked: Sequence[Frame]) -> list[bytes]:
    """One reply for two requests."""
    transaction, address, count = asked[0]
    return [answer(transaction, address, min(2 * count, 125))]


def only_the_first(asked: Sequence[Frame]) -> list[bytes]:
    return in_order(asked)[:1]


def nothing(asked: Sequence[Frame]) -> list[bytes]:  # noqa: ARG001
    return []


@asynccontextmanager
async def device(behave: Callable[[Sequence[Frame]], list[bytes]]) -> AsyncIterator[int]:
    """Answers single requests rightly, and more of them in its own way."""

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while data := await reader.read(4096):
            fields = [struct.unpack_from(">HHHBBHH", data, n) for n in range(0, len(data), 12)]
            asked = [(f[0], f[5], f[6]) for f in fields]
            for reply in behave(asked) if len(asked) > 1 else in_order(asked):
                writer.write(reply)
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    async with server:
        yield server.sockets[0].getsockname()[1]


def client(port: int, timeout_s: float = 1.0) -> ModbusClient:
    transport = TcpTransport(host="127.0.0.1", port=port)
    settings = LinkSettings(transport=transport, timeout_s=timeout_s, requests_in_flight=IN_FLIGHT)
    return ModbusClient(settings)


async def test_a_device_that_answers_all_in_order_is_asked_for_all_at_once():
    bursts = []
    async with device(lambda asked: bursts.append(len(asked)) or in_order(asked)) as port:
        link = client(port)
        await link.open()
        assert await link.read_spans(SPANS) == RIGHT
        link.close()
    assert bursts == [IN_FLIGHT]


@pytest.mark.parametrize("behave", [backwards, twice, mixed, joined, only_the_first, nothing])
async def test_a_device_that_cannot_is_asked_one_at_a_time_and_told_once(behave):
    async with device(behave) as port:
        link = client(port)
        await link.open()
        with pytest.raises(LinkError, match="6 requests were in flight, from now on one at a time"):
            await link.read_spans(SPANS)
        with pytest.raises(LinkError, match="closed"):
            await link.read(0, 1)
        for _ in range(2):
            await link.open()
            assert await link.read_spans(SPANS) == RIGHT
        link.close()


async def test_one_silence_of_a_device_that_can_answer_many_costs_nothing_and_two_do():
    behaviour = [in_order, nothing, in_order, nothing, nothing]
    async with device(lambda asked: behaviour.pop(0)(asked)) as port:
        link = client(port)
        late = "within 1.0 s$"
        for complaint in (None, late, None, late, "from now on one at a time"):
            await link.open()
            assert await link.read(0, 1) == bytes(2)
            if complaint is None:
                assert await link.read_spans(SPANS) == RIGHT
            else:
                with pytest.raises(LinkError, match=complaint):
                    await link.read_spans(SPANS)
        await link.open()
        assert await link.read_spans(SPANS) == RIGHT
        link.close()


async def test_a_device_that_hangs_up_twice_running_is_asked_one_at_a_time():
    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while len(data := await reader.read(4096)) == 12:
            transaction, _, _, _, _, address, count = struct.unpack(">HHHBBHH", data)
            writer.write(answer(transaction, address, count))
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    async with server:
        link = client(server.sockets[0].getsockname()[1], timeout_s=60.0)
        for complaint in ("the connection$", "the connection; 6 requests .* one at a"):
            await link.open()
            with pytest.raises(LinkError, match=complaint):
                await link.read_spans(SPANS)
        await link.open()
        assert await link.read_spans(SPANS) == RIGHT
        link.close()
