"""The sample axis: unwrapped, and free of what does not fit it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.errors import LinkError
from acquisition.modbus.fifo_assembly import (
    WRAP,
    ChannelAssembly,
    CountedSamples,
    FifoPiece,
    SamplePlace,
    UncountedSamples,
)
from acquisition.modbus.ring_profile import U32, RingLayout, Slot
from acquisition.modbus.timeline import Refusal, Timeline, ahead
from core.samples.axis import Epochs

LAYOUT = RingLayout(1, 50, 8, 600_000, 0, 16, 65)
NS_PER_SLOT = 50 * 10**9 // 600
NOTHING = np.empty((1, 50), dtype=np.int16)


def slot(n: int, sequence: int = 0, index: int = 0, shift_s: float = 0.0, shift_index: int = 0):
    """Slot number n after one with the given counters."""
    start_ns = 1_767_225_600 * 10**9 + n * NS_PER_SLOT + round(shift_s * 1e9)
    seconds, rest_ns = divmod(start_ns, 10**9)
    return Slot(
        (sequence + n) % U32,
        (index + n * 50 + shift_index) % U32,
        seconds,
        rest_ns // 1000,
        1,
        NOTHING,
        (sequence + n) & 0xFFFF,
        epoch=1,
    )


def epochs(first: int) -> Epochs:
    return Epochs(first * 10**9, trusts_device=False)


@given(a=st.integers(0, U32 - 1), distance=st.integers(-(2**31), 2**31 - 1))
def test_the_distance_of_two_counters_survives_the_wrap(a, distance):
    assert ahead((a + distance) % U32, a) == distance


@given(
    sequence=st.integers(0, U32 - 1),
    index=st.integers(0, U32 - 1),
    steps=st.lists(st.integers(1, 10**6), max_size=20),
)
def test_the_index_never_wraps_wherever_the_device_started(sequence, index, steps):
    timeline = Timeline(LAYOUT, epochs(0))
    assert timeline.place(slot(0, sequence, index)) == index
    n = 0
    for step in steps:
        n += step
        assert timeline.place(slot(n, sequence, index)) == index + 50 * n
    assert timeline.epochs.number == 0


@pytest.mark.parametrize("shift_s", [3600, -3600, -0.1, 4e9])
def test_the_index_decides_where_a_slot_belongs_and_not_its_stamp(shift_s):
    timeline = Timeline(LAYOUT, epochs(0))
    timeline.place(slot(0))
    assert timeline.place(slot(1, shift_s=shift_s)) == 50
    assert timeline.place(slot(2)) == 100
    assert timeline.epochs.number == 0


def test_a_microsecond_field_of_a_million_is_no_time_and_spoils_nothing():
    timeline = Timeline(LAYOUT, epochs(0))
    assert timeline.place(slot(0)) == 0
    wrong = Slot(1, 50, 1_767_225_600, 1_000_000, 1, NOTHING, 1, epoch=1)
    assert timeline.place(wrong) is Refusal.IMPOSSIBLE_TIME
    assert timeline.place(slot(2)) == 100


def test_an_index_that_starts_anew_is_a_reset_and_not_four_thousand_million_samples():
    timeline = Timeline(LAYOUT, epochs(0))
    timeline.place(slot(0, index=4_000_000_000))
    assert timeline.place(slot(1, index=0)) is Refusal.INCONSISTENT_INDEX
    assert timeline.place(slot(2, index=0)) == 100
    assert timeline.epochs.number == 1


def test_an_older_slot_of_the_same_axis_is_a_repetition_and_one_of_another_time_is_not():
    timeline = Timeline(LAYOUT, epochs(0))
    timeline.place(slot(5))
    assert timeline.repeats(slot(3))
    assert not timeline.repeats(slot(3, shift_s=60))
    assert not timeline.repeats(slot(3, shift_index=50))


def counted_one_less(n: int) -> Slot:
    """The samples and the time of the slot before, under the number of this one."""
    return replace(slot(n - 1), sequence=n, trailer=n)


@pytest.mark.parametrize("n_wrong", [1, 2, 3, 8])
@pytest.mark.parametrize(
    "wrong",
    [counted_one_less, lambda n: slot(n, shift_index=1), lambda n: slot(n, shift_index=-50 * n)],
)
def test_slots_that_only_their_number_or_index_misplaces_are_no_reset(n_wrong, wrong):
    timeline = Timeline(LAYOUT, epochs(0))
    timeline.place(slot(0))
    for n in range(1, n_wrong + 1):
        assert timeline.place(wrong(n)) is Refusal.INCONSISTENT_INDEX
    assert timeline.place(slot(n_wrong + 1)) == 50 * (n_wrong + 1)
    assert timeline.epochs.number == 0


def test_a_device_that_goes_on_to_count_otherwise_has_been_reset():
    timeline = Timeline(LAYOUT, epochs(0))
    timeline.place(slot(0))
    placed = [timeline.place(slot(n, shift_index=1)) for n in range(1, 12)]
    assert placed[:9] == [Refusal.INCONSISTENT_INDEX] * 9
    assert placed[9:] == [501, 551]
    assert timeline.epochs.number == 1


RATE_HZ = 600.0


def counted(removes: bool = True) -> CountedSamples:
    return CountedSamples(RATE_HZ, epochs(7), removes=removes)


@given(
    st.integers(0, WRAP - 1),
    st.lists(st.tuples(st.integers(0, 20 * WRAP), st.floats(0.0, 0.3)), min_size=1, max_size=20),
)
def test_gaps_are_exact_however_often_the_counter_has_wrapped(first, steps):
    """The host sees each sample late by up to 0.3 s; old samples were thrown away before."""
    samples, index = counted(), first
    samples.place(first % WRAP, 0.0)
    for gap, late_s in steps:
        index += 1 + gap
        now_s = (index - first) / RATE_HZ + late_s
        assert samples.place(index % WRAP, now_s) == SamplePlace(7, index)


@pytest.mark.parametrize(
    ("first", "passed_s", "then"), [(30_000, 0.1, 0), (1000, 10 * WRAP / RATE_HZ, 21_000)]
)
def test_a_counter_that_time_does_not_explain_begins_an_epoch(first, passed_s, then):
    """At once, or after a long absence."""
    samples = counted()
    samples.place(first, 0.0)

    assert samples.place(then, passed_s) == SamplePlace(8, then)
    assert samples.place(then + 1, passed_s) == SamplePlace(8, then + 1)


@pytest.mark.parametrize(("has_asked", "epoch"), [(True, 8), (False, 7)])
def test_a_counter_that_stops_with_its_device_begins_an_epoch_if_none_waited(has_asked, epoch):
    samples = counted()
    samples.place(100, 0.0)
    samples.note_drained(5.0 if has_asked else 0.0)

    assert samples.place(101, 5.0) == SamplePlace(epoch, 101)
    assert samples.place(102, 5.0) == SamplePlace(epoch, 102)


@pytest.mark.parametrize(("passed_s", "is_ambiguous"), [(1.0, False), (55.0, True), (1e6, True)])
def test_what_waits_in_a_queue_is_doubted_after_half_a_wrap(passed_s, is_ambiguous):
    samples = counted()
    assert not samples.is_ambiguous(passed_s)
    samples.place(0, 0.0)
    assert samples.is_ambiguous(passed_s) is is_ambiguous


def test_samples_that_a_queue_shows_again_are_not_taken_twice():
    samples = counted(removes=False)
    for n in range(100, 120):
        samples.place(n, 0.0)

    shown_again = [samples.place(n, 0.01) for n in range(110, 123)]

    assert shown_again == [None] * 10 + [SamplePlace(7, n) for n in (120, 121, 122)]


def reading(n_samples: int, first: int = 0) -> FifoPiece:
    return FifoPiece(first + np.arange(n_samples), np.zeros((1, n_samples), dtype=np.int16))


def uncounted() -> UncountedSamples:
    return UncountedSamples(RATE_HZ, epochs(7), tolerance_s=0.1)


def test_without_a_counter_samples_are_counted_here():
    samples = uncounted()
    placed = [run for n in (3, 0, 2) for run in samples.runs(reading(n), 0.0)]
    assert [(run.epoch, run.first_index) for run in placed] == [(7, 0), (7, 3)]


def test_a_loss_shows_by_the_clock_and_nothing_is_joined_across_it():
    samples = uncounted()
    for second in range(1, 30):
        samples.runs(reading(600), second)
        assert not samples.has_lost(second + 0.02 * (second % 3))
    samples.runs(reading(600 - 72), 30.0)

    assert samples.has_lost(30.0)
    samples.begin()
    [run] = samples.runs(reading(1), 30.0)
    assert (run.epoch, run.first_index) == (8, 0)
    assert not samples.has_lost(31.0)


@pytest.mark.parametrize("drift", [-500e-6, 500e-6])
def test_a_poor_crystal_is_no_loss(drift):
    samples = uncounted()
    for second in range(1, 3600):
        samples.runs(reading(600), second)
        assert not samples.has_lost(second * (1.0 + drift))


def test_a_counter_that_counts_nothing_is_refused():
    samples = CountedSamples(600.0, epochs(1), removes=True)
    counters = np.array([5000, 40_000, 12, 33_333])
    with pytest.raises(LinkError, match="the sample counter restarts"):
        samples.runs(FifoPiece(counters, np.zeros((2, 4), dtype=np.int16)), 0.0)


def test_channels_that_count_differently_are_not_put_side_by_side():
    assembly = ChannelAssembly(2, CountedSamples(600.0, epochs(1), removes=True))
    with pytest.raises(LinkError, match="channels 0 and 1 are 5004 samples apart"):
        assembly.place([reading(4, 5000), reading(4)], 0.0)


def test_a_channel_that_gives_nothing_holds_the_others_back_in_bounded_memory():
    assembly = ChannelAssembly(2, CountedSamples(600.0, epochs(1), removes=True))
    for n in range(1000):
        assert assembly.place([reading(30, 30 * n), reading(0)], n * 0.05) == []
    assert max(map(len, assembly._waiting)) <= 1100
