"""The sample axis: unwrapped, and free of what does not fit it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.modbus.ring_layout import U32, RingLayout
from acquisition.modbus.slot import Slot
from acquisition.modbus.timeline import Refusal, Timeline, ahead

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
    )


@given(a=st.integers(0, U32 - 1), distance=st.integers(-(2**31), 2**31 - 1))
def test_the_distance_of_two_counters_survives_the_wrap(a, distance):
    assert ahead((a + distance) % U32, a) == distance


@given(
    sequence=st.integers(0, U32 - 1),
    index=st.integers(0, U32 - 1),
    steps=st.lists(st.integers(1, 10**6), max_size=20),
)
def test_the_index_never_wraps_wherever_the_device_started(sequence, index, steps):
    timeline = Timeline(LAYOUT)
    assert timeline.place(slot(0, sequence, index)) == index
    n = 0
    for step in steps:
        n += step
        assert timeline.place(slot(n, sequence, index)) == index + 50 * n
    assert timeline.n_resets == 0


@pytest.mark.parametrize("shift_s", [3600, -3600, -0.1, 4e9])
def test_the_index_decides_where_a_slot_belongs_and_not_its_stamp(shift_s):
    timeline = Timeline(LAYOUT)
    timeline.place(slot(0))
    assert timeline.place(slot(1, shift_s=shift_s)) == 50
    assert timeline.place(slot(2)) == 100
    assert timeline.n_resets == 0


def test_a_microsecond_field_of_a_million_is_no_time_and_spoils_nothing():
    timeline = Timeline(LAYOUT)
    assert timeline.place(slot(0)) == 0
    wrong = Slot(1, 50, 1_767_225_600, 1_000_000, 1, NOTHING, 1)
    assert timeline.place(wrong) is Refusal.IMPOSSIBLE_TIME
    assert timeline.place(slot(2)) == 100


def test_an_index_that_starts_anew_is_a_reset_and_not_four_thousand_million_samples():
    timeline = Timeline(LAYOUT)
    timeline.place(slot(0, index=4_000_000_000))
    assert timeline.place(slot(1, index=0)) is Refusal.INCONSISTENT_INDEX
    assert timeline.place(slot(2, index=0)) == 100
    assert timeline.n_resets == 1


def test_an_older_slot_of_the_same_axis_is_a_repetition_and_one_of_another_time_is_not():
    timeline = Timeline(LAYOUT)
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
    timeline = Timeline(LAYOUT)
    timeline.place(slot(0))
    for n in range(1, n_wrong + 1):
        assert timeline.place(wrong(n)) is Refusal.INCONSISTENT_INDEX
    assert timeline.place(slot(n_wrong + 1)) == 50 * (n_wrong + 1)
    assert timeline.n_resets == 0


def test_a_device_that_goes_on_to_count_otherwise_has_been_reset():
    timeline = Timeline(LAYOUT)
    timeline.place(slot(0))
    placed = [timeline.place(slot(n, shift_index=1)) for n in range(1, 12)]
    assert placed[:9] == [Refusal.INCONSISTENT_INDEX] * 9
    assert placed[9:] == [501, 551]
    assert timeline.n_resets == 1
