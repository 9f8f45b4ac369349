"""What counters, the clock of the host and stamps of the interface say of missing samples."""

import asyncio
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial

import can
import numpy as np
import pytest
from rigs.standing_clock import StandingClock
from rigs.tiers import covering

from acquisition.can.source import CanSource
from acquisition.delivery.arrival import Arrival, InterfaceClock

RATE_HZ = 600.0
NS_PER_S = 1_000_000_000
START_NS = 1_767_225_600 * NS_PER_S
WIDTHS = [4, 5, 8, 12, 16, 20, 24, 32]


class CounterPlant:
    """One message with a counter of some width and a sample that is its own number."""

    def __init__(
        self, settings_of, assembler_by, n_bits: int, counts: str = "samples", n: int = 1
    ) -> None:
        self._n_bits = n_bits
        self._n = n
        self._per_count = n if counts == "frames" else 1
        names = [f"x{i}" for i in range(n)]
        text = [f' SG_ c : 0|{n_bits}@1+ (1,0) [0|0] "" N\n']
        text += [f' SG_ {s} : {32 + 16 * i}|16@1- (1,0) [0|0] "V" N\n' for i, s in enumerate(names)]
        head = f'VERSION ""\nBU_: N\nBO_ 256 M: {4 + 2 * n} N\n'
        signals = {"x": " ".join(f"M.{s}" for s in names)}
        counted = {"counters": ("M.c",), "counter_counts": counts}
        self.assembler = assembler_by(settings_of(head + "".join(text), signals, **counted))

    def frame(self, index: int, counter: int | None = None):
        counter = index if counter is None else counter
        c = (counter // self._per_count) % (1 << self._n_bits)
        samples = (np.arange(index, index + self._n) % 2**15).astype("<i2").tobytes()
        return 256, c.to_bytes(4, "little") + samples

    def take(self, indices, at_s: float, counters=None):
        frames = [self.frame(i, c) for i, c in zip(indices, counters or indices, strict=True)]
        return self.assembler.take(frames, START_NS + round(at_s * NS_PER_S))


@pytest.fixture
def plant(settings_of, assembler_by):
    return partial(CounterPlant, settings_of, assembler_by)


def summary(blocks):
    """Number, stretch and what was refused, of blocks that are joined where they continue."""
    joined = []
    for block in blocks:
        index = np.arange(block.first_index, block.stop_index)
        assert block.counts.shape == (1, len(index))
        if joined and joined[-1][:2] == [block.epoch, block.first_index] and not block.rejected:
            joined[-1][1] = block.stop_index
        else:
            joined.append([block.epoch, block.stop_index, block.first_index, block.rejected])
    return [(epoch, first, stop, rejected) for epoch, stop, first, rejected in joined]


@pytest.mark.parametrize(
    ("n_bits", "counted"), covering(WIDTHS, [(1, "samples"), (2, "samples"), (2, "frames")])
)
def test_a_counter_that_wraps_goes_on(n_bits, counted, plant):
    n, counts = counted
    plant = plant(n_bits, n=n, counts=counts)
    start = max(0, (1 << n_bits) * (n if counts == "frames" else 1) - 300)
    blocks = []
    for first in range(start, start + 600, 6):
        blocks += plant.take(range(first, first + 6, n), first / RATE_HZ)
    modulus = (1 << n_bits) * (n if counts == "frames" else 1)
    assert summary(blocks) == [(0, start % modulus, start % modulus + 600, ())]
    samples = np.concatenate([b.counts[0] for b in blocks])
    np.testing.assert_array_equal(samples, np.arange(start, start + 600) % 2**15)


@pytest.mark.parametrize(
    ("n_bits", "shortest", "longest", "most_late_s"),
    [
        *((n, 0, min((1 << n) // 2 - 1, 3000), 0.0) for n in WIDTHS),
        # the clock tells how often the counter wrapped in a silence
        *((n, 1 << n, (20 << n) - 1, min(0.3, 0.3 * (1 << n) / RATE_HZ)) for n in (8, 12, 16)),
    ],
)
def test_every_gap_that_a_counter_and_the_clock_can_tell_is_exact(
    n_bits, shortest, longest, most_late_s, plant
):
    random = np.random.default_rng(n_bits)
    plant = plant(n_bits)
    blocks, index = plant.take(range(3), 0.0), 3
    for _ in range(300):
        index += int(random.integers(shortest, longest + 1))
        late_s = float(random.uniform(0.0, most_late_s))
        blocks += plant.take(range(index, index + 3), index / RATE_HZ + late_s)
        index += 3
    assert {block.epoch for block in blocks} == {0}
    assert all(block.rejected == () for block in blocks)
    assert blocks[-1].stop_index == index
    assert sum(block.n_samples for block in blocks) == 903
    for block in blocks:
        samples = np.arange(block.first_index, block.stop_index) % 2**15
        np.testing.assert_array_equal(block.counts[0], samples)


@pytest.mark.parametrize("n_bits", [12, 16, 24, 32])
def test_a_counter_that_falls_back_to_zero_begins_a_new_epoch(n_bits, plant):
    plant = plant(n_bits)
    n_before = (1 << n_bits) // 2 + 1000 if n_bits < 32 else 10**6
    blocks = plant.take(range(n_before, n_before + 100), 0.0)
    blocks += plant.take(range(100), 3.0)
    assert summary(blocks) == [(0, n_before, n_before + 100, ()), (1, 0, 100, ())]


def test_a_single_frame_with_a_wild_counter_moves_nothing(plant):
    plant = plant(32)
    blocks = plant.take(range(10), 0.0)
    blocks += plant.take(range(10, 20), 0.02, counters=[*range(10, 15), 4_000_000, *range(16, 20)])
    assert summary(blocks) == [(0, 0, 15, ()), (0, 16, 20, ())]
    assert plant.assembler.refused == Counter({"impossible_counter": 1})


def test_frames_that_come_again_or_late_are_refused_and_counted(plant):
    plant = plant(16)
    blocks = plant.take([0, 1, 1, 2, 4, 3, 5, 5, 6, 2], 0.0)
    assert summary(blocks) == [(0, 0, 3, ()), (0, 4, 7, ())]
    assert plant.assembler.refused == Counter({"duplicate_frame": 2, "out_of_order_frame": 2})


@pytest.mark.parametrize(
    ("n_bits", "first", "at_s", "expected"),
    [
        # frames that waited in a buffer all arrive at once, after any time
        (16, 10, 5.0, [(0, 0, 3000, ())]),
        # a second frame confirms the jump
        (32, 10**6, 0.02, [(0, 0, 10, ()), (0, 10**6, 10**6 + 2990, ())]),
    ],
)
def test_neither_a_stalled_host_nor_a_far_jump_loses_samples(n_bits, first, at_s, expected, plant):
    plant = plant(n_bits)
    blocks = plant.take(range(10), 0.0) + plant.take(range(first, first + 2990), at_s)
    assert summary(blocks) == expected


def test_host_stamps_rise_with_the_index_and_follow_the_nominal_rate(plant):
    plant = plant(16)
    random = np.random.default_rng(3)
    blocks = []
    for first in range(0, 5000, 50):
        late_s = float(random.exponential(0.01))
        blocks += plant.take(range(first, first + 50), (first + 50) / RATE_HZ + late_s)
    starts = np.array([b.start_ns - START_NS for b in blocks])
    expected = np.array([b.first_index for b in blocks]) / RATE_HZ * NS_PER_S
    np.testing.assert_allclose(starts - expected, starts[0], atol=2.0)


BLOCK = 50
UPTIME_S = 4711.0
PATIENCE_S = 120.0
DBC = 'VERSION ""\nBU_: N\nBO_ 544 M: 8 N\n' + "".join(
    f' SG_ s{c} : {16 * c}|16@1- (1,0) [0|0] "V" N\n' for c in range(4)
)


class Adapter:
    """A module that counts nothing, at an adapter with a clock of its own, on a real bus."""

    def __init__(self, channel: str, clock: StandingClock, drift: float = 0.0) -> None:
        self._bus = can.Bus(channel=channel, interface="virtual", preserve_timestamps=True)
        self._clock = clock
        self._drift = drift
        self.n_samples = 0

    def send(self, late_s: float, stamp_of=lambda uptime_s: uptime_s, n_lost: int = 0) -> None:
        """A block that passes on the bus and is read later; the stamp told is that of its end."""
        self.n_samples += n_lost
        self._clock.s = (self.n_samples + BLOCK) / RATE_HZ + late_s
        for n in range(BLOCK):
            self.n_samples += 1
            uptime_s = UPTIME_S + self.n_samples / RATE_HZ * (1.0 + self._drift)
            samples = (self.n_samples + np.arange(4)).astype("<i2").tobytes()
            stamp_s = stamp_of(uptime_s) if n == BLOCK - 1 else uptime_s
            message = can.Message(stamp_s, 544, is_extended_id=False, data=samples)
            self._bus.send(message)

    def close(self) -> None:
        self._bus.shutdown()


@pytest.fixture
def clock() -> StandingClock:
    return StandingClock()


@pytest.fixture
def adapter_on(clock) -> Iterator[Callable[..., Adapter]]:
    """Builds adapters on a virtual bus; the drift of their clock as keyword."""
    with ExitStack() as closing:

        def build(channel: str, **drift: float) -> Adapter:
            adapter = Adapter(channel, clock, **drift)
            closing.callback(adapter.close)
            return adapter

        yield build


@pytest.fixture
def source_on(settings_of, clock, counts_calibration):
    def build(channel: str) -> CanSource:
        signals = {f"c{n}": f"M.s{n}" for n in range(4)}
        settings = settings_of(DBC, signals, channel, stamps="interface", stale_after_s=3600.0)
        return CanSource(settings, counts_calibration(n_channels=4, n_slow=0), clock)

    return build


async def taken(stream, n_samples: int) -> list:
    """What is delivered until the bus has been read so far, and nothing more comes."""
    blocks = []
    async with asyncio.timeout(PATIENCE_S):
        while not blocks or blocks[-1].stop_index < n_samples:
            blocks.append(await anext(stream))
    return blocks


@pytest.mark.parametrize("drift", [-100e-6, 0.0, 100e-6])
async def test_a_busy_host_neither_hides_nor_makes_losses_where_the_interface_stamps(
    drift, source_on, adapter_on
):
    random = np.random.default_rng(20261122)
    channel, blocks = f"busy host {drift}", []
    adapter = adapter_on(channel, drift=drift)
    async with source_on(channel).connect() as stream:
        for _ in range(80):
            adapter.send(late_s=float(random.uniform(0.003, 0.050)))
            blocks += await taken(stream, adapter.n_samples)
    assert blocks[-1].stop_index == 80 * BLOCK
    assert [r for b in blocks for r in b.rejected] == []
    assert {b.stamp_fault for b in blocks} == {None}
    assert blocks[-1].clock.n_faults == 0


async def test_the_interface_clock_finds_a_single_lost_sample_on_a_busy_host(source_on, adapter_on):
    random = np.random.default_rng(20261122)
    channel, blocks = "lost sample", []

    async def read(stream) -> None:
        async for block in stream:
            blocks.append(block)

    adapter = adapter_on(channel)
    async with source_on(channel).connect() as stream, asyncio.TaskGroup() as tasks:
        reading = tasks.create_task(read(stream))
        n = 0
        while n < 70 or blocks[-1].stop_index < adapter.n_samples - BLOCK:
            adapter.send(float(random.uniform(0.003, 0.050)), n_lost=int(n == 50))
            n += 1
            await asyncio.sleep(0.03)
        reading.cancel()
    n_stored = sum(b.n_samples for b in blocks)
    [rejected] = [r for b in blocks for r in b.rejected]
    assert rejected.reason == "uncounted_loss"
    assert n_stored + rejected.n_samples == blocks[-1].stop_index
    assert blocks[-1].samples[0][0] == blocks[-1].first_index + 1


@pytest.mark.parametrize(
    ("stamp_of", "fault"),
    [
        (lambda uptime_s: uptime_s - 100.0, "stamp_regressed"),
        (lambda _: 0.0, "stamp_repeated"),
        (lambda _: float("nan"), "stamp_repeated"),
        (lambda uptime_s: uptime_s + 100.0, "stamp_jumped"),
    ],
)
async def test_a_stamp_that_is_wrong_is_not_used_and_told(stamp_of, fault, source_on, adapter_on):
    channel, blocks = f"wrong stamp {fault}", []
    adapter = adapter_on(channel)
    async with source_on(channel).connect() as stream:
        for n in range(10):
            adapter.send(0.0, stamp_of if n == 3 else lambda uptime_s: uptime_s)
            blocks += await taken(stream, adapter.n_samples)
    assert {b.stamp_fault for b in blocks} == {None, fault}
    assert blocks[-1].stamp_fault is None
    assert blocks[-1].clock.n_faults > 0
    assert blocks[-1].stop_index == 10 * BLOCK
    times = np.array([b.start_ns - round(b.first_index * 1e9 / RATE_HZ) for b in blocks])
    assert np.ptp(times) < 1_000_000


def test_a_clock_that_begins_anew_is_believed_from_the_second_stamp_on():
    clock = InterfaceClock()
    late = (0.0, 0.010, 0.004, 0.0, 0.020)
    old = [(100.0 + n, n + late[n]) for n in range(5)]
    new = [(0.5 + n, 5.0 + n) for n in range(3)]
    found = [clock.arrival(s, Arrival(round(r * 1e9), r)) for s, r in [*old, *new]]
    assert [fault for _, fault in found] == [None] * 5 + ["stamp_regressed", None, None]
    for n, (arrival, _) in enumerate(found):
        assert arrival.steady_s == pytest.approx(n, abs=1.3e-3)
        assert arrival.host_ns == pytest.approx(n * 1e9, abs=1.3e6)
