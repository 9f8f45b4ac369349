"""A device that lies is disconnected; none of its lies becomes a sample."""

import asyncio
from itertools import islice

import numpy as np
import pytest

from acquisition.errors import ConfigError, FrameError, LinkError
from acquisition.modbus.link import ModbusLink
from acquisition.modbus.transport import LinkSettings, TcpTransport


def changed(position: int, delta: int):
    """Lie: one byte of the reply is off."""

    async def lie(request, reply, writer):  # noqa: ARG001
        wrong = bytearray(reply)
        wrong[position] = (wrong[position] + delta) % 256
        writer.write(bytes(wrong))

    return lie


def sent(make):
    """Lie: these bytes instead of the reply."""

    async def lie(request, reply, writer):
        writer.write(make(request, reply))

    return lie


def resized(n_bytes: int):
    """Lie: consistent reply with more or fewer bytes of data."""

    def make(request, reply):
        data = (reply[9:] + bytes(64))[: len(reply) - 9 + n_bytes]
        body = request[6:8] + bytes([len(data) % 256]) + data
        return request[:4] + len(body).to_bytes(2, "big") + body

    return sent(make)


def with_length(n: int):
    return sent(lambda _, reply: reply[:4] + n.to_bytes(2, "big") + reply[6:])


async def truncated_then_closed(request, reply, writer):  # noqa: ARG001
    writer.write(reply[: len(reply) // 2])
    writer.close()


async def closed_at_once(request, reply, writer):  # noqa: ARG001
    writer.close()


async def silent(request, reply, writer):
    pass


async def too_late(request, reply, writer):  # noqa: ARG001
    await asyncio.sleep(0.8)
    writer.write(reply)


async def twice(request, reply, writer):  # noqa: ARG001
    writer.write(reply)
    await writer.drain()
    writer.write(reply)


LIES = {
    "transaction id one ahead": changed(1, 1),
    "transaction id of the request before": changed(1, -1),
    "transaction id zero": sent(lambda _, reply: b"\0\0" + reply[2:]),
    "protocol id": changed(3, 1),
    "another unit": changed(6, 1),
    "unit zero": sent(lambda _, reply: reply[:6] + b"\0" + reply[7:]),
    "function 4 for 3": changed(7, 1),
    "write echo": sent(lambda request, _: request[:7] + b"\x06" + request[8:]),
    "exception for another function": sent(
        lambda request, _: request[:4] + b"\0\3" + request[6:7] + b"\x84\2"
    ),
    "exception and more": sent(
        lambda request, _: request[:4] + b"\0\3" + request[6:7] + b"\x83\2\0"
    ),
    "byte count two short": changed(8, -2),
    "byte count two long": changed(8, 2),
    "odd byte count": changed(8, -1),
    "one register fewer": resized(-2),
    "one register more": resized(2),
    "an odd number of bytes": resized(-1),
    "truncated, then closed": truncated_then_closed,
    "truncated, then silent": sent(lambda _, reply: reply[:-1]),
    "garbage before the reply": sent(lambda _, reply: b"\xde\xad\xbe\xef" + reply),
    "600 bytes of garbage before the reply": sent(lambda _, reply: bytes(600) + reply),
    "a banner": sent(lambda *_: b"SSH-2.0-OpenSSH_9.2\r\n"),
    "bytes after the reply": sent(lambda _, reply: reply + b"\0\0"),
    "the reply twice": twice,
    "length 0": with_length(0),
    "length 2": with_length(2),
    "length one long": sent(lambda _, r: r[:5] + bytes([(r[5] + 1) % 256]) + r[6:]),
    "length 65535": with_length(65535),
    "its own request": sent(lambda request, _: request),
    "silence": silent,
    "the reply too late": too_late,
    "hanging up": closed_at_once,
}


async def _collect(stream, blocks) -> None:
    async for block in stream:
        blocks.append(block)


@pytest.mark.parametrize("n_honest", [0, 1, 3], ids=["header", "slot", "later"])
@pytest.mark.parametrize("lie", LIES.values(), ids=LIES.keys())
async def test_no_lie_becomes_a_sample(lie, n_honest, hostile, device, source_at):
    source = source_at(hostile.port, timeout_s=0.6)
    async with source.connect() as stream:
        blocks = [await anext(stream)]
        device.produce(3)
        hostile.lie, hostile.n_honest = lie, n_honest
        with pytest.raises(LinkError):
            await _collect(stream, blocks)
    hostile.lie = None
    device.produce(2)
    async with source.connect() as stream:
        while blocks[-1].stop_index < device.ledger.n_samples("U1"):
            blocks.append(await anext(stream))
    samples = np.concatenate([block.samples[0] for block in blocks])
    np.testing.assert_array_equal(samples, np.arange(300))
    assert not any(block.rejected for block in blocks)


@pytest.mark.parametrize(
    ("code", "error"),
    [(1, ConfigError), (2, ConfigError), (3, ConfigError)]
    + [(code, LinkError) for code in (0, 4, 5, 6, 10, 11, 0xEE)],
)
async def test_an_exception_reply_says_whether_trying_again_helps(code, error, hostile, source_at):
    hostile.lie = sent(
        lambda request, _: request[:4] + b"\0\3" + request[6:7] + bytes([0x83, code])
    )
    with pytest.raises(error, match=f"exception {code} "):
        async with source_at(hostile.port).connect():
            pass


async def test_a_reply_in_slices_of_one_byte_reads_the_same(hostile, device, source_at, read_until):
    async def sliced(request, reply, writer):  # noqa: ARG001
        for byte in reply:
            writer.write(bytes([byte]))
            await asyncio.sleep(0)

    hostile.lie = sliced
    async with source_at(hostile.port).connect() as stream:
        await anext(stream)
        device.produce(2)
        blocks = await read_until(stream, 150)
    samples = np.concatenate([block.samples[0] for block in blocks])
    np.testing.assert_array_equal(samples, np.arange(50, 150))


async def test_only_reads_are_seen_on_the_wire(hostile, device, source_at):
    for function in (3, 4):
        async with source_at(hostile.port, function=function).connect() as stream:
            await anext(stream)
            device.produce(9)
    assert {request[7] for request in hostile.requests} == {3, 4}
    assert all(int.from_bytes(request[10:12], "big") <= 125 for request in hostile.requests)


async def test_a_device_that_hangs_up_is_noticed_before_the_time_out(hostile, source_at):
    hostile.lie = closed_at_once
    with pytest.raises(LinkError, match="the device closed the connection"):
        async with source_at(hostile.port).connect():
            pass


async def test_after_a_missed_reply_the_link_is_closed_so_that_it_meets_nobody(hostile, link_to):
    link = link_to(hostile.port, timeout_s=0.1)
    await link.open()
    hostile.lie = too_late
    with pytest.raises(LinkError):
        await link.read(0, 16)
    hostile.lie = None
    with pytest.raises(LinkError, match="closed"):
        await link.read(0, 16)
    assert len(hostile.requests) == 1


async def test_a_late_reply_that_a_gateway_passes_on_to_the_next_connection_is_nobodys(hostile):
    settings = LinkSettings(
        transport=TcpTransport(host="127.0.0.1", port=hostile.port), timeout_s=0.1
    )
    late = []

    async def keep(request, reply, writer):  # noqa: ARG001
        late.append(reply)

    async def pass_on(request, reply, writer):  # noqa: ARG001
        writer.write(late[0])

    for lie, error in ((keep, LinkError), (pass_on, FrameError)):
        hostile.lie = lie
        link = ModbusLink(settings)
        await link.open()
        with pytest.raises(error):
            await link.read(len(late), 1)  # the same length, function and unit: only its id tells


async def test_transactions_are_numbered_on_from_connection_to_connection_and_never_zero(hostile):
    transport = TcpTransport(host="127.0.0.1", port=hostile.port)
    *_, last = islice(transport.transactions, 64_998)
    for _ in range(2):
        link = ModbusLink(LinkSettings(transport=transport))
        await link.open()
        for _ in range(2):
            await link.read(0, 1)
        link.close()

    found = [int.from_bytes(request[:2], "big") for request in hostile.requests]
    assert (last, found) == (64_998, [64_999, 65_000, 1, 2])
