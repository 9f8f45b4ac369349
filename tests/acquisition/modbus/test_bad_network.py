"""A network that spoils traffic and a DAQ that lies: no false sample, and every loss counted."""

import asyncio
import contextlib
import dataclasses
from collections import Counter
from contextlib import AsyncExitStack

import numpy as np
import pytest
from rigs.hostile_sources import COMMON, CONTENTS, KINDS, Trial, assert_all_true, lies_to
from rigs.modbus import ModbusRig
from rigs.registers import ChannelFifoTcpRig, FifoTcpRig, PolledTcpRig, VectorTcpRig
from rigs.tcp_proxy import MaliciousProxy
from rigs.tiers import covering, first_fast

from acquisition.errors import ConfigError, LinkError
from acquisition.modbus.transport import TcpTransport
from acquisition.simulated.devices import ring_faults as faults
from acquisition.simulated.devices.modbus_links import ModbusTcpServer
from acquisition.simulated.devices.ring_device import RingDevice, RingDeviceSettings
from core.samples.blocks import SampleBlock

HARMLESS = {"delay": 0.3, "slice": 0.5, "coalesce": 0.5}
HARMFUL = {"duplicate": 0.1, "half_close": 0.05, "reset": 0.05, "swallow": 0.05}
MISCHIEF = HARMLESS | HARMFUL
CHANGED = {"corrupt": 0.2, "corrupt_request": 0.15}
"""Only a ring carries checksums that tell."""

N_BLOCKS = {PolledTcpRig: 40, VectorTcpRig: 200, FifoTcpRig: 80, ChannelFifoTcpRig: 80}
"""A block takes ten replies of polled registers, two of a rack, four or more of queues."""

ONE_AT_A_TIME = [{kind: share} for kind, share in MISCHIEF.items()]
ALL_TOGETHER = {kind: share / 3.0 for kind, share in MISCHIEF.items()}


def mischief(*given: dict[str, float]) -> list:
    return [pytest.param(shares, id="+".join(shares)) for shares in given]


async def read_through_a_proxy(build, kind: type, mischief: dict[str, float], n_blocks: int):
    """Connect as often as it takes; return the rig as it was left, and the blocks."""

    class Behind(kind):
        timeout_s = 0.1 if set(mischief) - set(HARMLESS) else 60.0

        async def plug_in(self) -> None:
            await super().plug_in()
            self.proxy = MaliciousProxy(self._server.port, 3, **mischief)
            await self._plug.enter_async_context(self.proxy)

        def _transport(self) -> TcpTransport:
            return TcpTransport(host="127.0.0.1", port=self.proxy.port)

    blocks: list = []
    async with build(Behind) as rig:
        while len(blocks) < n_blocks or blocks[-1].stop_index < rig.n_kept:
            with contextlib.suppress(LinkError, ConfigError):
                async with rig.source.connect() as stream:
                    rig.run(rig.step_samples)
                    async for block in stream:
                        blocks.append(block)
                        if block.stop_index >= rig.n_kept:
                            if len(blocks) >= n_blocks:
                                break
                            rig.run(rig.step_samples)
    return rig, blocks


@pytest.fixture
def build(counting_feed, counts_calibration, stepped_clock):
    return lambda kind: kind(counting_feed(), counts_calibration(), stepped_clock)


@pytest.mark.parametrize(
    ("kind", "mischief"), covering(list(N_BLOCKS), mischief(*ONE_AT_A_TIME, ALL_TOGETHER))
)
async def test_no_network_fault_makes_a_false_sample_or_hides_a_loss(kind, mischief, build):
    rig, blocks = await read_through_a_proxy(build, kind, mischief, N_BLOCKS[kind])
    assert_all_true(blocks)
    assert sum(rig.proxy.n_done.values()) >= len(mischief)


@pytest.mark.parametrize(
    "mischief",
    mischief(*ONE_AT_A_TIME, CHANGED, {kind: s / 3.0 for kind, s in (MISCHIEF | CHANGED).items()}),
)
async def test_no_mischief_of_the_network_costs_a_ring_an_uncounted_sample(mischief, build):
    rig, blocks = await read_through_a_proxy(build, ModbusRig, mischief, 100)
    # a slot that was changed on the way at each of four readings is rejected
    assert_all_true(blocks, loses_nothing=True, may_reject="corrupt" in mischief)
    assert blocks[-1].stop_index == rig.n_kept
    assert sum(rig.proxy.n_done.values()) >= len(mischief)


FEW = 4
MANY = {"tcp": 100, "rtu": 20}
N_AT_ONCE = {"tcp": 20, "rtu": 5}
"""On a busy machine, replies of many lines at once would all come after the time-out."""

OF_RIGHT_FORM = [
    COMMON["fewer registers"],  # a queue may be that short
    *(make for lies in CONTENTS.values() for make in lies.values()),
]
"""Read again where a checksum of the content tells; all others cost the connection."""


def cases() -> list:
    """Each wrong reply to one source on each wire is fast; all contents to all sources are long."""
    fast, long = [], []
    for wire in ("tcp", "rtu"):
        sources = [source for link, source in KINDS if link == wire]
        lies = {name: make for source in sources for name, make in lies_to(wire, source).items()}
        for n, (name, make) in enumerate(lies.items()):
            lied_to = [source for source in sources if name in lies_to(wire, source)]
            for source in lied_to:
                case, id_ = (KINDS[wire, source], make), f"{source} over {wire}: {name}"
                long.append(pytest.param(*case, MANY[wire], marks=pytest.mark.long, id=id_))
                if source == lied_to[n % len(lied_to)]:
                    fast.append(pytest.param(*case, FEW, id=f"{id_}, a few"))
    return fast + long


@pytest.mark.parametrize(("kind", "make", "n_contents"), cases())
async def test_no_wrong_reply_becomes_a_sample(
    kind, make, n_contents, counting_feed, counts_calibration, stepped_clock
):
    n_trials = min(n_contents, N_AT_ONCE[kind.link])
    async with AsyncExitStack() as plant:
        trials = []
        for seed in range(n_trials):
            rig = kind(counting_feed(), counts_calibration(), type(stepped_clock)())
            trials.append(Trial(await plant.enter_async_context(rig), seed))
        await asyncio.gather(*(trial.lie(make, n_contents // n_trials) for trial in trials))
    assert sum(trial.n_told for trial in trials) >= n_contents
    assert make in OF_RIGHT_FORM or any(trial.n_refused for trial in trials)
    for trial in trials:
        trial.assert_nothing_false()


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


@pytest.mark.parametrize("n_gaps", first_fast(1, [400, 4000]))
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
