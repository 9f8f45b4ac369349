"""A 16-bit counter and the host's clock give an index that never wraps and gaps that are exact."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.errors import FrameError
from acquisition.modbus.counted_samples import WRAP, CountedSamples, Place
from acquisition.modbus.fifo_assembly import ChannelAssembly, place_records
from acquisition.modbus.uncounted_samples import UncountedSamples
from acquisition.registers.fifo_layout import FifoPiece

RATE_HZ = 600.0


def counted(removes: bool = True) -> CountedSamples:
    return CountedSamples(RATE_HZ, removes=removes, epoch=7)


@given(
    st.integers(0, WRAP - 1),
    st.lists(st.tuples(st.integers(0, 20 * WRAP), st.floats(0.0, 0.3)), min_size=1, max_size=20),
)
def test_gaps_are_exact_however_often_the_counter_has_wrapped(first: int, steps) -> None:
    """The host sees each sample late by up to 0.3 s; old samples were thrown away before."""
    samples, index = counted(), first
    samples.place(first % WRAP, 0.0)
    for gap, late_s in steps:
        index += 1 + gap
        now_s = (index - first) / RATE_HZ + late_s
        assert samples.place(index % WRAP, now_s) == Place(7, index)


@pytest.mark.parametrize(
    ("first", "passed_s", "then"), [(30_000, 0.1, 0), (1000, 10 * WRAP / RATE_HZ, 21_000)]
)
def test_a_counter_that_time_does_not_explain_begins_an_epoch(first, passed_s, then) -> None:
    """At once, or after a long absence."""
    samples = counted()
    samples.place(first, 0.0)

    assert samples.place(then, passed_s) == Place(8, then)
    assert samples.place(then + 1, passed_s) == Place(8, then + 1)


@pytest.mark.parametrize(("passed_s", "is_ambiguous"), [(1.0, False), (55.0, True), (1e6, True)])
def test_what_waits_in_a_queue_is_doubted_after_half_a_wrap(passed_s, is_ambiguous) -> None:
    samples = counted()
    assert not samples.is_ambiguous(passed_s)
    samples.place(0, 0.0)
    assert samples.is_ambiguous(passed_s) is is_ambiguous


def test_samples_that_a_queue_shows_again_are_not_taken_twice() -> None:
    samples = counted(removes=False)
    for n in range(100, 120):
        samples.place(n, 0.0)

    shown_again = [samples.place(n, 0.01) for n in range(110, 123)]

    assert shown_again == [None] * 10 + [Place(7, n) for n in (120, 121, 122)]


def uncounted() -> UncountedSamples:
    return UncountedSamples(RATE_HZ, tolerance_s=0.1, epoch=7)


def deliver(samples: UncountedSamples, n: int) -> list[Place]:
    return [samples.place() for _ in range(n)]


def test_without_a_counter_samples_are_counted_here() -> None:
    assert deliver(uncounted(), 3) == [Place(7, 0), Place(7, 1), Place(7, 2)]


def test_a_loss_shows_by_the_clock_and_nothing_is_joined_across_it() -> None:
    samples = uncounted()
    for second in range(1, 30):
        deliver(samples, 600)
        assert not samples.has_lost(second + 0.02 * (second % 3))
    deliver(samples, 600 - 72)

    assert samples.has_lost(30.0)
    samples.begin()
    assert samples.place() == Place(8, 0)
    assert not samples.has_lost(31.0)


@pytest.mark.parametrize("drift", [-500e-6, 500e-6])
def test_a_poor_crystal_is_no_loss(drift: float) -> None:
    samples = uncounted()
    for second in range(1, 3600):
        deliver(samples, 600)
        assert not samples.has_lost(second * (1.0 + drift))


def test_a_counter_that_counts_nothing_is_refused() -> None:
    samples = CountedSamples(600.0, removes=True, epoch=1)
    counters = np.array([5000, 40_000, 12, 33_333])
    with pytest.raises(FrameError, match="does not count"):
        place_records(FifoPiece(counters, np.zeros((2, 4), dtype=np.int16)), samples, 0.0)


def test_channels_that_count_differently_are_not_put_side_by_side() -> None:
    assembly = ChannelAssembly(2, CountedSamples(600.0, removes=True, epoch=1))
    pieces = [
        FifoPiece(first + np.arange(4), np.zeros((1, 4), dtype=np.int16)) for first in (5000, 0)
    ]
    with pytest.raises(FrameError, match="counts -5004 samples apart"):
        assembly.place(pieces, 0.0)


def test_a_channel_that_gives_nothing_holds_the_others_back_in_bounded_memory() -> None:
    assembly = ChannelAssembly(2, CountedSamples(600.0, removes=True, epoch=1))
    nothing = FifoPiece(np.arange(0), np.zeros((1, 0), dtype=np.int16))
    for n in range(1000):
        piece = FifoPiece(30 * n + np.arange(30), np.zeros((1, 30), dtype=np.int16))
        assert assembly.place([piece, nothing], n * 0.05) == []
    assert max(map(len, assembly._waiting)) <= 1100
