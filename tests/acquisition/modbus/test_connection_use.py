"""Devices that keep no connection: closed after each reply, after a rest, or one for everybody."""

import asyncio

import pytest
from rigs.hostile_modbus import HostileServer
from rigs.polled import CALIBRATION, Follower, device_of, map_of, take

from acquisition.errors import ConfigError, LinkError
from acquisition.modbus.identity import ExpectedIdentification
from acquisition.modbus.polled_source import PolledSettings, PolledSource
from acquisition.modbus.transport import ConnectionUse, TcpTransport
from acquisition.registers.cells import Cell
from acquisition.registers.register_map import Signature

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

        def source(connection: ConnectionUse) -> PolledSource:
            transport = TcpTransport(host="127.0.0.1", port=server.port)
            settings = PolledSettings(
                transport=transport, timeout_s=5.0, connection=connection, identity=ACME
            )
            return PolledSource(settings, SIGNED, ("wave",), CALIBRATION, clock)

        yield device, server, source


async def test_a_device_that_closes_after_each_reply_is_read_by_a_connection_for_each(plant):
    _, _, source = plant

    with pytest.raises(LinkError, match="closed the connection"):
        await take(source(ConnectionUse.KEPT), 1)
    blocks = await take(source(ConnectionUse.PER_REPLY), 5)

    assert [b.first_index for b in blocks] == [0, 1, 2, 3, 4]
    assert [float(b.samples[0, 0]) for b in blocks] == [100.0, 101.0, 102.0, 103.0, 104.0]


async def test_between_replies_no_connection_is_held(plant):
    _, server, source = plant
    server.lie = None

    async with source(ConnectionUse.PER_REPLY).connect() as stream:
        await anext(stream)
        while server.n_connected:
            await asyncio.sleep(0)
        assert (await anext(stream)).first_index == 1


@pytest.mark.parametrize("other", ["vendor", "signature"])
async def test_another_device_is_noticed_at_the_next_poll(plant, other: str):
    device, _, source = plant

    async with source(ConnectionUse.PER_REPLY).connect() as stream:
        await anext(stream)
        if other == "vendor":
            device.identification = {0: b"Other"}
        else:
            device.image.put(Cell(address=1), 43)
        with pytest.raises(ConfigError, match=r"another device"):
            await anext(stream)
