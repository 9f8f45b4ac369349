"""What a device that lies makes of a link; see `test_hostile_daq` for the samples."""

import asyncio
from itertools import islice

import numpy as np
import pytest

from acquisition.errors import ConfigError, FrameError, LinkError
from acquisition.modbus.link import ModbusLink
from acquisition.modbus.transport import LinkSettings, TcpTransport


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
