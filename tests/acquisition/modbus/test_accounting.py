"""Offered = stored + gap + rejected, whatever is lost on the way."""

import dataclasses
from collections import Counter

import numpy as np
import pytest
from rigs.tiers import fast_and_long

from acquisition.simulated.devices import ring_faults as faults
from acquisition.simulated.devices.modbus_links import ModbusTcpServer
from acquisition.simulated.devices.ring_device import RingDevice, RingDeviceSettings
from core.samples.blocks import SampleBlock

N_SLOTS = 16
SLOT = 50


class LossyPlant:
    """Produces slots with faults and books what a perfect reader has to find."""

    def __init__(self, device: RingDevice, seed: int) -> None:
        self._device = device
        self._random = np.random.default_rng(seed)
        self._misplaced: set[int] = set()
        self._faults = {
            "gap": faults.dropped,
            "torn_slot": faults.torn,
            "wrong_sequence": faults.wrong_sequence,
            "inconsistent_index": self._wrong_index,
            "impossible_time": self._impossible_time,
            "damaged_slot": self._damage,
        }
        self.lost: Counter[str] = Counter()
        self.n_gaps = 0

    def run(self) -> None:
        """Fill the ring not quite, ending with a good slot, or run it over."""
        if self._random.random() < 0.1:
            n_overwritten = int(self._random.integers(1, 3 * N_SLOTS))
            self.n_gaps += 1
            self.lost["gap"] += n_overwritten * SLOT
            self._misplaced.clear()
            self._device.produce(N_SLOTS - 1 + n_overwritten)
            return
        for _ in range(self._random.integers(0, N_SLOTS - 2)):
            self._one()
        self._good()

    def _one(self) -> None:
        if self._random.random() < 0.4:
            self._good()
            return
        kind = str(self._random.choice(list(self._faults)))
        place = (self._device.newest + 1) % N_SLOTS
        self._device.produce(1, self._faults[kind])
        if kind == "gap" and place in self._misplaced:
            kind = "wrong_sequence"  # what lies there is still the nonsense of the round before
        if kind == "wrong_sequence":
            self._misplaced.add(place)
        elif kind != "gap":
            self._misplaced.discard(place)
        self.n_gaps += 1
        self.lost[kind] += SLOT

    def _good(self) -> None:
        self._misplaced.discard((self._device.newest + 1) % N_SLOTS)
        self._device.produce(1)

    def _wrong_index(self, slot):
        shift = int(self._random.integers(1, 2**31))
        return dataclasses.replace(slot, first_index=(slot.first_index + shift) % 2**32)

    def _impossible_time(self, slot):
        return dataclasses.replace(slot, microseconds=slot.microseconds + 1_000_000)

    def _damage(self, slot):
        return dataclasses.replace(slot, damage=int(self._random.integers(1, 2**32)))


async def read_all(stream, device: RingDevice, blocks: list[SampleBlock]) -> None:
    while not blocks or blocks[-1].stop_index < device.ledger.n_samples("U1"):
        blocks.append(await anext(stream))


@pytest.mark.parametrize("n_gaps", fast_and_long(400, 4000))
async def test_every_injected_gap_is_found_and_counted_exactly(
    n_gaps, counting_feed, source_at, counts_calibration
):
    settings = RingDeviceSettings(samples_per_slot=SLOT, n_slots=N_SLOTS)
    device = RingDevice(counting_feed(n_channels=1), settings=settings)
    plant = LossyPlant(device, seed=20261121)
    blocks: list[SampleBlock] = []
    async with ModbusTcpServer(device) as server:
        source = source_at(server.port, calibration=counts_calibration(n_channels=1))
        while plant.n_gaps < n_gaps:
            async with source.connect() as stream:
                await read_all(stream, device, blocks)
                for _ in range(20):
                    plant.run()
                    await read_all(stream, device, blocks)
            plant.run()  # this one passes while nobody is connected
        async with source.connect() as stream:
            await read_all(stream, device, blocks)

    found: Counter[str] = Counter()
    stop = 0
    for block in blocks:
        index = np.arange(block.first_index, block.stop_index)
        np.testing.assert_array_equal(block.samples[0], index % 2**15)
        rejected = Counter({r.reason: r.n_samples for r in block.rejected})
        found += rejected
        found["gap"] += block.first_index - stop - rejected.total()
        stop = block.stop_index
    n_stored = sum(block.n_samples for block in blocks)
    assert len({block.epoch for block in blocks}) == 1
    assert plant.n_gaps >= n_gaps
    assert found == plant.lost
    assert n_stored + found.total() == device.ledger.n_samples("U1")
