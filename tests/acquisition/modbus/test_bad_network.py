"""A network that delays, slices, joins, repeats, changes, swallows and resets: no false sample."""

import contextlib

import numpy as np
import pytest
from rigs.tcp_proxy import MaliciousProxy

from acquisition.daq.ring_device import RingDevice
from acquisition.daq.ring_server import ModbusRingServer
from acquisition.daq.ring_shape import RingDeviceSettings
from acquisition.errors import ConfigError, LinkError

HARMLESS = {"delay": 0.3, "slice": 0.5, "coalesce": 0.5}
HARMFUL = {
    "duplicate": 0.05,
    "corrupt": 0.1,
    "corrupt_request": 0.05,
    "half_close": 0.02,
    "reset": 0.02,
    "swallow": 0.02,
}


@pytest.fixture
def plant(counting_feed) -> RingDevice:
    return RingDevice(counting_feed(n_channels=3), settings=RingDeviceSettings(n_slots=64))


async def read_through(plant, source, n_rounds: int) -> list:
    """Read all that a plant produces, connecting again as often as it takes."""
    blocks: list = []
    for _ in range(n_rounds):
        plant.produce(3)
        while not blocks or blocks[-1].stop_index < plant.ledger.n_samples("U1"):
            with contextlib.suppress(LinkError, ConfigError):
                async with source.connect() as stream:
                    async for block in stream:
                        blocks.append(block)
                        if block.stop_index == plant.ledger.n_samples("U1"):
                            break
    return blocks


def assert_all_true(blocks, plant) -> None:
    """Nothing false, nothing twice, and what is missing was found changed on every reading."""
    stop = blocks[0].first_index
    for block in blocks:
        index = np.arange(block.first_index, block.stop_index)
        expected = (index + np.arange(3)[:, np.newaxis]) % 2**15
        np.testing.assert_array_equal(block.samples, expected)
        assert block.first_index - stop == sum(r.n_samples for r in block.rejected)
        stop = block.stop_index
    assert stop == plant.ledger.n_samples("U1")
    assert len({block.epoch for block in blocks}) == 1
    assert not any(block.stamp_fault for block in blocks)
    assert all(block.slow["slow0"].value == 45.0 for block in blocks)


async def test_a_slow_network_that_cuts_and_joins_pieces_costs_nothing(plant, source_at):
    async with (
        ModbusRingServer(plant) as server,
        MaliciousProxy(server.port, seed=1, **HARMLESS) as proxy,
        source_at(proxy.port).connect() as stream,
    ):
        blocks = [await anext(stream)]
        for _ in range(20):
            plant.produce(3)
            while blocks[-1].stop_index < plant.ledger.n_samples("U1"):
                blocks.append(await anext(stream))
    assert_all_true(blocks, plant)
    assert all(proxy.n_done[kind] > 10 for kind in HARMLESS)


@pytest.mark.parametrize("kind", HARMFUL)
async def test_no_mischief_of_the_network_makes_a_false_sample_or_an_uncounted_loss(
    kind, plant, source_at
):
    async with (
        ModbusRingServer(plant) as server,
        MaliciousProxy(server.port, seed=2, **{kind: HARMFUL[kind] * 3}) as proxy,
    ):
        source = source_at(proxy.port, timeout_s=0.1)
        blocks = await read_through(plant, source, 30)
    assert_all_true(blocks, plant)
    assert proxy.n_done[kind] > 3


@pytest.mark.parametrize("seed", range(2))
async def test_all_mischief_together_makes_no_false_sample_and_no_uncounted_loss(
    seed, plant, source_at
):
    async with (
        ModbusRingServer(plant) as server,
        MaliciousProxy(server.port, seed, **HARMLESS | HARMFUL) as proxy,
    ):
        source = source_at(proxy.port, timeout_s=0.1)
        blocks = await read_through(plant, source, 25)
    assert_all_true(blocks, plant)
    assert proxy.n_done["corrupt"] > 10
