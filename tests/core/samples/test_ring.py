"""The ring holds the tail of all that was written, and accounts for the rest."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rigs.blocks import given_block

from core.quality import GOOD, Reading, Reason, bad, missing
from core.samples.blocks import Rejection, SampleBlock
from core.samples.gaps import Gap
from core.samples.ring import Ring

CAPACITY = 40


def block(first_index: int, n_samples: int, epoch: int = 1, **changes: object) -> SampleBlock:
    """Channel 0 is the sample's own index, so that loss, repetition or reordering shows."""
    index = np.arange(first_index, first_index + n_samples)
    samples = np.array([index, -index]).astype(np.float32)
    given = {"start_ns": first_index * 10**7, "channel_quality": (GOOD, GOOD)} | changes
    return given_block("U1", epoch, first_index, rate_hz=100.0, samples=samples, **given)


@given(st.lists(st.integers(1, 60), min_size=1, max_size=20), st.integers(0, 10**9))
def test_the_ring_equals_the_tail_of_all_that_was_written(sizes, start):
    ring, index = Ring(CAPACITY), start
    for size in sizes:
        assert ring.write(block(index, size)) is None
        index += size
    first = max(start, index - CAPACITY)
    window = ring.read(first, index)
    exact = np.arange(first, index).astype(np.float32)
    np.testing.assert_array_equal(window.samples, [exact, -exact])
    assert window.start_ns == first * 10**7
    assert ring.account.n_stored == ring.account.n_offered == sum(sizes)


STEPS = st.tuples(st.integers(1, 30), st.integers(0, 50), st.integers(0, 5), st.booleans())


@given(st.lists(STEPS, min_size=1, max_size=30))
def test_every_offered_sample_is_stored_flagged_missing_or_rejected(steps):
    ring, index, gaps, good_samples = Ring(CAPACITY), 0, 0, 0
    ring.write(block(0, 1))
    index, rejected = 1, 0
    for size, lost, refused, good in steps:
        index += lost + refused
        quality = (GOOD, GOOD if good else bad(Reason.SENSOR_FAILURE))
        rejections = (Rejection("torn", refused),) if refused else ()
        gap = ring.write(block(index, size, channel_quality=quality, rejected=rejections))
        assert (gap.n_samples if gap else 0) == lost + refused
        index, gaps, rejected = index + size, gaps + lost, rejected + refused
        good_samples += size if good else 0
    account = ring.account
    assert account.n_offered == index
    assert (account.n_gap, sum(account.rejected.values())) == (gaps, rejected)
    assert account.n_stored == 1 + good_samples


def test_a_gap_is_exact_and_repeated_samples_are_dropped_and_counted():
    ring = Ring(CAPACITY)
    ring.write(block(100, 10))
    assert ring.write(block(117, 5)) == Gap(1, 110, 7, 117 * 10**7)
    assert ring.holds(117, 122)
    assert not ring.holds(109, 122)
    with pytest.raises(LookupError, match="109 to 121"):
        ring.read(109, 122)
    ring = Ring(CAPACITY)
    ring.write(block(0, 10))
    ring.write(block(0, 10))
    ring.write(block(5, 10))
    assert ring.account.n_repeated == 15
    assert ring.account.n_stored == 15
    np.testing.assert_array_equal(ring.read(0, 15).samples[0], np.arange(15))


def test_a_restarted_device_begins_a_new_count_without_a_giant_gap():
    ring = Ring(CAPACITY)
    ring.write(block(4_000_000_000, 10))
    later_ns = 4_000_000_100 * 10**7
    assert ring.write(block(3, 10, epoch=2, start_ns=later_ns)) == Gap(2, 0, 3, later_ns)
    assert ring.account.n_restarts == 1
    assert not ring.holds(4_000_000_000, 4_000_000_010)
    np.testing.assert_array_equal(ring.read(3, 13).samples[0], np.arange(3, 13))
    ring.write(block(0, CAPACITY, epoch=3))
    ring.write(block(0, 5, epoch=4))
    assert not ring.holds(0, 6)  # the rest are old samples of another epoch


def test_a_window_has_the_worst_quality_and_the_mean_of_slow_readings_that_half_of_it_has():
    ring = Ring(CAPACITY)
    clipped = (bad(Reason.CLIPPED), GOOD)
    ring.write(block(0, 10, channel_quality=clipped, slow={"oil": Reading(99.0)}))
    ring.write(block(10, 10, slow={"oil": Reading(40.0)}))
    ring.write(block(20, 10, slow={"oil": Reading(50.0)}))
    window = ring.read(10, 30)
    assert window.channel_quality == (GOOD, GOOD)
    assert window.slow["oil"].value == 45.0
    assert ring.read(15, 30).slow["oil"].value == pytest.approx((5 * 40.0 + 10 * 50.0) / 15)
    assert ring.read(9, 30).channel_quality == (bad(Reason.CLIPPED), GOOD)
    ring = Ring(CAPACITY)
    ring.write(block(0, 10, slow={"oil": Reading(40.0), "power": Reading(1.0)}))
    ring.write(block(10, 8, slow={"oil": Reading(49.75)}))
    ring.write(block(18, 3, slow={"oil": Reading(49.0)}))
    assert ring.read(0, 18).slow["power"] == Reading(1.0)
    slow = ring.read(0, 21).slow  # more than half of it is missing
    assert (slow["oil"].value, slow["power"]) == (45.0, missing(Reason.NOT_MEASURED))


def test_a_count_that_was_found_and_not_begun_says_nothing_of_what_is_missing():
    """As of a counter that went on while whoever reads it began again."""
    ring = Ring(CAPACITY)
    ring.write(block(0, 10))
    late = block(40_000, 10, epoch=2, start_ns=20 * 10**9, rejected=(Rejection("torn", 3),))
    assert ring.write(late) is None
    assert (ring.account.n_gap, ring.account.rejected, ring.account.n_restarts) == (0, {}, 1)
    assert ring.holds(40_000, 40_010)


def test_what_was_rejected_before_a_block_counts_once_and_before_the_first_never():
    ring = Ring(CAPACITY)
    ring.write(block(0, 10))
    torn = block(15, 10, rejected=(Rejection("torn", 5),))
    for _ in range(3):
        ring.write(torn)
    account = ring.account
    assert (account.rejected, account.n_gap, account.n_repeated) == ({"torn": 5}, 0, 20)
    assert account.n_offered == account.n_stored + 5 == 25
    ring = Ring(CAPACITY)
    assert ring.write(block(5000, 10, rejected=(Rejection("torn", 50),))) is None
    assert ring.account.n_offered == 10


@pytest.mark.parametrize("refused", [(5,), (1, 4), (2, 7), (9, -1)])
def test_no_more_is_rejected_than_the_index_leaves_room_for(refused):
    ring = Ring(CAPACITY)
    ring.write(block(0, 10))
    named = tuple(Rejection(f"reason {n}", count) for n, count in enumerate(refused))
    assert ring.write(block(12, 10, rejected=named)) == Gap(1, 10, 2, 12 * 10**7)
    account = ring.account
    assert (account.n_gap, sum(account.rejected.values()), account.n_offered) == (0, 2, 22)
    assert min(account.rejected.values()) > 0
