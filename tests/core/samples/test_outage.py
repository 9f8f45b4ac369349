"""What nobody saw is recorded: exactly where the device went on counting, estimated where not."""

from dataclasses import replace

import numpy as np
from rigs.blocks import given_block

from core.quality import GOOD
from core.samples.blocks import SampleBlock
from core.samples.gaps import Gap, Reach, outage, restart

RATE_HZ = 100.0
T0 = 1_767_225_600_000_000_000


def at(index: int, epoch: int = 7, shift_s: float = 0.0) -> SampleBlock:
    """A block of a device that counts from T0 on."""
    start_ns = time_ns(index) + round(shift_s * 1e9)
    samples = np.zeros((1, 10), dtype=np.float32)
    return given_block("U1", epoch, index, start_ns, RATE_HZ, samples, (GOOD,))


def time_ns(index: int) -> int:
    return T0 + index * 10_000_000


KEPT = Reach(7, 1000, time_ns(1000))


def test_a_device_that_went_on_counting_makes_the_hole_exact() -> None:
    assert outage(KEPT, at(4321)) == [Gap(7, 1000, 3321, time_ns(4321), time_ns(1000))]
    for follows_or_comes_again in (1000, 990, 0):
        assert outage(KEPT, at(follows_or_comes_again)) == []


def test_what_is_recorded_already_is_not_recorded_twice_unless_in_an_earlier_count() -> None:
    gaps = (Gap(7, 1000, 100, time_ns(1100)), Gap(7, 1500, 200, time_ns(1700)))

    found = outage(replace(KEPT, gaps=gaps), at(2000))

    assert [(gap.first_index, gap.n_samples) for gap in found] == [(1100, 400), (1700, 300)]
    assert outage(replace(KEPT, gaps=[*gaps, *found]), at(2000)) == []

    earlier = Gap(7, 50_000, 60_000, T0 - 3600 * 10**9)

    assert outage(replace(KEPT, gaps=[earlier]), at(60_000)) == outage(KEPT, at(60_000))


def test_whatever_was_recorded_before_all_records_together_are_the_hole() -> None:
    rng = np.random.default_rng(5)
    for _ in range(200):
        gaps: list[Gap] = []
        for last in np.sort(rng.integers(1000, 5000, 4)):
            gaps += outage(replace(KEPT, gaps=gaps), at(int(last)))
        ranges = (range(gap.first_index, gap.first_index + gap.n_samples) for gap in gaps)
        covered = [i for indices in ranges for i in indices]
        assert sorted(covered) == list(range(1000, int(last)))


def test_a_device_that_counts_anew_leaves_an_estimate_and_what_it_has_counted() -> None:
    anew = at(0, epoch=8, shift_s=60.0)

    assert outage(KEPT, anew) == [
        Gap(7, 1000, 5000, anew.start_ns, time_ns(1000), is_estimated=True)
    ]

    anew = at(250, epoch=8, shift_s=60.0)
    begin_ns = T0 + 60_000_000_000

    assert outage(KEPT, anew) == [
        Gap(7, 1000, 5000, begin_ns, time_ns(1000), is_estimated=True),
        Gap(8, 0, 250, anew.start_ns, begin_ns),
    ]


def test_a_count_that_time_or_the_clock_contradicts_is_not_believed() -> None:
    """As of a source that begins at zero with every start of the service, in the same epoch."""
    anew = at(0, epoch=7, shift_s=3600.0)

    [gap] = outage(KEPT, anew)

    assert (gap.is_estimated, gap.n_samples) == (True, 359_000)
    assert (gap.start_ns, gap.stop_ns) == (time_ns(1000), anew.start_ns)

    [gap] = outage(KEPT, at(5000, epoch=8, shift_s=-3600.0))

    assert (gap.is_estimated, gap.n_samples) == (True, 0)
    assert gap.start_ns == gap.stop_ns


def test_killed_again_before_a_result_an_estimated_outage_goes_on_where_it_ended() -> None:
    first = outage(KEPT, at(0, epoch=8, shift_s=60.0))
    second = outage(replace(KEPT, gaps=first), at(0, epoch=9, shift_s=90.0))

    assert [gap.n_samples for gap in (*first, *second)] == [5000, 3000]
    assert second[0].start_ns == first[0].stop_ns


def test_a_device_that_restarts_under_the_service_leaves_the_time_in_which_it_was_away() -> None:
    lost = restart(KEPT, at(40, epoch=8, shift_s=60.0))

    assert lost == Gap(7, 1000, 5000, T0 + 60_000_000_000, time_ns(1000), is_estimated=True)
    assert restart(KEPT, at(40, epoch=8, shift_s=10.0)) is None
