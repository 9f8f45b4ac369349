"""The sample axis: unwrapped, and free of what does not fit it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.modbus.ring_layout import U32, RingLayout
from acquisition.modbus.slot import Slot
from acquisition.modbus.timeline import Refusal, Timeline, ahead

LAYOUT = RingLayout(1, 50, 8, 600_000, 0, 16, 61)
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


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ({"shift_index": 1}, Refusal.INCONSISTENT_INDEX),
        ({"shift_index": -50}, Refusal.INCONSISTENT_INDEX),
        ({"shift_s": 3600}, Refusal.IMPOSSIBLE_TIME),
        ({"shift_s": -3600}, Refusal.IMPOSSIBLE_TIME),
        ({"shift_s": -0.1}, Refusal.IMPOSSIBLE_TIME),
    ],
)
def test_one_slot_that_does_not_fit_is_refused_and_the_next_is_not(fault, reason):
    timeline = Timeline(LAYOUT)
    timeline.place(slot(0))
    assert timeline.place(slot(1, **fault)) is reason
    assert timeline.place(slot(2)) == 100


def test_a_microsecond_field_of_a_million_is_no_time():
    timeline = Timeline(LAYOUT)
    wrong = slot(0)
    assert (
        timeline.place(Slot(0, 0, wrong.seconds, 1_000_000, 1, NOTHING, 0))
        is Refusal.IMPOSSIBLE_TIME
    )


def test_a_device_clock_that_was_set_costs_one_slot_and_no_epoch():
    timeline = Timeline(LAYOUT)
    timeline.place(slot(0))
    assert timeline.place(slot(1, shift_s=3600)) is Refusal.IMPOSSIBLE_TIME
    assert timeline.place(slot(2, shift_s=3600)) == 100
    assert timeline.place(slot(3, shift_s=3600)) == 150
    assert timeline.n_resets == 0


def test_an_index_that_starts_anew_is_a_reset_and_not_four_thousand_million_samples():
    timeline = Timeline(LAYOUT)
    timeline.place(slot(0, index=4_000_000_000))
    assert timeline.place(slot(1, index=0)) is Refusal.INCONSISTENT_INDEX
    assert timeline.place(slot(2, index=0)) == 100
    assert timeline.n_resets == 1


def test_an_older_slot_of_the_same_axis_is_a_repetition():
    timeline = Timeline(LAYOUT)
    timeline.place(slot(5))
    assert timeline.repeats(slot(3))
    assert not timeline.repeats(slot(3, shift_s=60))
