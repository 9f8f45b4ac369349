"""Counters of any width make one unbroken axis: wrap, gap, restart, and what nobody can know."""

from collections import Counter
from functools import partial

import numpy as np
import pytest
from rigs.tiers import covering

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
def test_neither_a_stall_of_the_host_nor_a_far_jump_loses_a_sample(
    n_bits, first, at_s, expected, plant
):
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
