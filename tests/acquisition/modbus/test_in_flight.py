"""Several requests in flight: their answers are those of a single one, or nobody's."""

import asyncio
import struct
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager

import pytest

from acquisition.errors import LinkError
from acquisition.modbus.client import ModbusClient
from acquisition.modbus.requests import Span
from acquisition.modbus.transport import LinkSettings, TcpTransport

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


def client(port: int) -> ModbusClient:
    transport = TcpTransport(host="127.0.0.1", port=port)
    return ModbusClient(
        LinkSettings(transport=transport, timeout_s=0.2, requests_in_flight=IN_FLIGHT)
    )


async def test_a_device_that_answers_all_in_order_is_asked_for_all_at_once():
    bursts = []
    async with device(lambda asked: bursts.append(len(asked)) or in_order(asked)) as port:
        link = client(port)
        await link.open()
        assert await link.read_spans(SPANS) == RIGHT
        link.close()
    assert bursts == [IN_FLIGHT]


@pytest.mark.parametrize(
    ("behave", "error"),
    [
        (backwards, LinkError),
        (twice, LinkError),
        (mixed, LinkError),
        (joined, LinkError),
        (only_the_first, LinkError),
        (nothing, LinkError),
    ],
)
async def test_a_device_that_cannot_is_asked_one_at_a_time_from_then_on_and_told_once(
    behave, error
):
    async with device(behave) as port:
        link = client(port)
        await link.open()
        with pytest.raises(error, match="6 requests were in flight, from now on one at a time"):
            await link.read_spans(SPANS)
        with pytest.raises(LinkError, match="closed"):
            await link.read(0, 1)
        for _ in range(2):
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
        link = client(server.sockets[0].getsockname()[1])
        for complaint in (
            "closed the connection$",
            "closed the connection; 6 requests .* one at a",
        ):
            await link.open()
            with pytest.raises(LinkError, match=complaint):
                await link.read_spans(SPANS)
        await link.open()
        assert await link.read_spans(SPANS) == RIGHT
        link.close()
