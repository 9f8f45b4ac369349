"""Sample counts of a device: numbering, restarts, and gaps between counts."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rigs.blocks import given_block

from acquisition.recordings.manifest import MAX_INDEX
from core.monitor.assessment import AnalysisSettings
from core.monitor.monitor import UnitMonitor
from core.quality import GOOD
from core.samples.axis import DEVICE_EPOCHS, RECOUNTED_EPOCHS, Epochs
from core.samples.blocks import SampleBlock
from core.samples.gaps import Counts, Gap, Reach, outage, restart

RATE_HZ = 600.0
T0 = 1_767_225_600_000_000_000
NS_PER_S = 1_000_000_000
MILLION = 10**6


def at(index: int, late_s: float = 0.0, epoch: int = 7, n: int = 60) -> SampleBlock:
    """Samples of a device that counts from T0 on, or by so much later."""
    start_ns = T0 + round((index / RATE_HZ + late_s) * NS_PER_S)
    samples = np.zeros((4, n), dtype=np.float32)
    return given_block("U1", epoch, index, start_ns, RATE_HZ, samples, (GOOD,) * 4)


def place(block: SampleBlock) -> tuple[int, int, int]:
    """Where a block belongs."""
    return block.epoch, block.first_index, block.start_ns


@pytest.fixture
def counts() -> Counts:
    counts = Counts()
    assert place(counts.placed(at(MILLION))) == place(at(MILLION))
    return counts


def test_a_count_that_falls_back_while_time_goes_on_is_another_one(counts):
    placed = [counts.placed(at(60 * n, late_s=1700.0)) for n in range(20)]
    [epoch] = {block.epoch for block in placed}
    assert epoch >= RECOUNTED_EPOCHS
    assert [block.first_index for block in placed] == list(range(0, 1200, 60))


@pytest.mark.parametrize(
    "block",
    [at(MILLION), at(MILLION - 60), at(0), at(MILLION - 6000, late_s=0.9), at(0, late_s=-1700.0)],
)
def test_a_block_that_comes_once_more_with_its_own_time_stays_where_it_was(counts, block):
    assert place(counts.placed(block)) == place(block)
    assert counts.placed(at(MILLION + 60)).epoch == 7


def test_what_comes_again_in_the_new_count_is_a_repetition_there(counts):
    first, again = (counts.placed(at(0, late_s=1700.0)) for _ in range(2))
    assert place(first) == place(again)
    assert counts.placed(at(60, late_s=1700.0)).epoch == first.epoch
    found = [counts.placed(at(0, late_s=1700.0 + 10.0 * n)).epoch for n in range(5)]
    assert len(set(found)) == 5  # each time that it falls back it is another count


def test_an_epoch_that_the_device_tells_is_taken_as_it_is(counts):
    counts.placed(at(0, late_s=1700.0))
    assert counts.placed(at(0, late_s=1800.0, epoch=8)).epoch == 8
    assert counts.placed(at(60, late_s=1800.0, epoch=8)).epoch == 8


def test_another_process_goes_on_in_the_same_count_whatever_its_clock_says(counts):
    anew = counts.placed(at(0, late_s=1700.0))
    other = Counts()
    other.count = counts.count
    assert place(other.replayed(at(0, late_s=1700.0))) == place(anew)
    following = at(60, late_s=1700.0)
    assert place(other.placed(following)) == place(counts.placed(following))
    counts = Counts()
    counts.placed(at(MILLION))
    counts.placed(at(MILLION + 60, late_s=-3600.0))
    other = Counts()
    other.count = counts.count
    assert other.replayed(at(MILLION)).epoch == 7


def test_samples_after_an_untold_restart_are_analysed_and_a_repetition_is_not(unit):
    """A million samples, then from 0 on: results come again with the first whole segment."""
    settings = AnalysisSettings()
    counts, monitor = Counts(), UnitMonitor(unit, settings)
    list(monitor.steps(counts.placed(at(MILLION))))
    found = []
    for index in range(0, settings.segment_samples + 60, 60):
        for _ in range(2):
            found += monitor.steps(counts.placed(at(index, late_s=1700.0)))
    account = monitor.account
    assert len(found) == 1
    assert found[0].window.first_index == 0
    assert (account.n_restarts, account.n_repeated) == (1, index + 60)
    assert account.n_stored == index + 120
    [lost] = monitor.drain_gaps()
    stop_ns = at(MILLION).stop_ns
    n_lost = round((at(0, late_s=1700.0).start_ns - stop_ns) / NS_PER_S * RATE_HZ)
    begin_ns = at(0, late_s=1700.0).start_ns
    assert lost == Gap(7, MILLION + 60, n_lost, begin_ns, stop_ns, is_estimated=True)


def test_a_count_that_wrapped_is_no_gap_of_months(unit):
    """A reader that began again finds the low bits of a count that was gone on with."""
    counts, monitor = Counts(), UnitMonitor(unit, AnalysisSettings())
    stop = 2**32 + 10 * MILLION
    list(monitor.steps(counts.placed(at(stop))))
    found = at(stop + 6060)
    late = replace(found, first_index=found.first_index - 2**32)
    list(monitor.steps(counts.placed(late)))
    [lost] = monitor.drain_gaps()
    assert (lost.n_samples, lost.is_estimated) == (6000, True)
    assert monitor.account.n_gap == 0


BEGUN_NS = 1_767_225_600 * NS_PER_S

told = st.one_of(st.none(), st.integers(0, DEVICE_EPOCHS - 1))


def numbers(begun_s: int, restarts: list[int | None], trusts_device: bool) -> list[int]:
    """Numbers of the counts of one life, whose device tells 7 at first."""
    epochs = Epochs(BEGUN_NS + begun_s * NS_PER_S, trusts_device=trusts_device)
    epochs.begin_first(7)
    found = [epochs.number]
    for begun in restarts:
        epochs.begin(begun)
        found.append(epochs.number)
    return found


@given(restarts=st.lists(told, max_size=20), later=st.lists(told, max_size=20))
def test_what_an_adapter_counts_itself_has_another_number_in_each_of_its_lives(restarts, later):
    first = numbers(0, restarts, trusts_device=False)
    second = numbers(30, later, trusts_device=False)
    assert len({*first, *second}) == len(restarts) + len(later) + 2


@given(restarts=st.lists(told, max_size=20), later=st.lists(told, max_size=20))
def test_a_trusted_device_tells_its_number_and_what_it_hides_has_one_of_its_own(restarts, later):
    first = numbers(0, restarts, trusts_device=True)
    second = numbers(30, later, trusts_device=True)
    assert (first[0], second[0]) == (7, 7)
    shown = [*zip(restarts, first[1:], strict=True), *zip(later, second[1:], strict=True)]
    assert all(number == restart for restart, number in shown if restart is not None)
    hidden = [number for restart, number in shown if restart is None]
    assert len({*hidden}) == len(hidden)
    assert all(DEVICE_EPOCHS <= number < MAX_INDEX for number in hidden)


def test_an_epoch_that_is_wider_than_the_wire_still_changes_with_it():
    epochs = Epochs(BEGUN_NS, trusts_device=True)
    epochs.begin_first(-1)
    assert epochs.number == DEVICE_EPOCHS - 1
    epochs.begin(2**63 + 5)
    assert epochs.number == 5


HELD_RATE_HZ = 100.0


def ten_at(index: int, epoch: int = 7, shift_s: float = 0.0) -> SampleBlock:
    """A block of a device that counts from T0 on."""
    start_ns = time_ns(index) + round(shift_s * 1e9)
    samples = np.zeros((1, 10), dtype=np.float32)
    return given_block("U1", epoch, index, start_ns, HELD_RATE_HZ, samples, (GOOD,))


def time_ns(index: int) -> int:
    return T0 + index * 10_000_000


KEPT = Reach(7, 1000, time_ns(1000))


def test_a_device_that_went_on_counting_makes_the_hole_exact():
    assert outage(KEPT, ten_at(4321)) == [Gap(7, 1000, 3321, time_ns(4321), time_ns(1000))]
    for follows_or_comes_again in (1000, 990, 0):
        assert outage(KEPT, ten_at(follows_or_comes_again)) == []


def test_what_is_recorded_already_is_not_recorded_twice_unless_in_an_earlier_count():
    gaps = (Gap(7, 1000, 100, time_ns(1100)), Gap(7, 1500, 200, time_ns(1700)))

    found = outage(replace(KEPT, gaps=gaps), ten_at(2000))

    assert [(gap.first_index, gap.n_samples) for gap in found] == [(1100, 400), (1700, 300)]
    assert outage(replace(KEPT, gaps=[*gaps, *found]), ten_at(2000)) == []

    earlier = Gap(7, 50_000, 60_000, T0 - 3600 * 10**9)

    assert outage(replace(KEPT, gaps=[earlier]), ten_at(60_000)) == outage(KEPT, ten_at(60_000))


def test_whatever_was_recorded_before_all_records_together_are_the_hole():
    rng = np.random.default_rng(5)
    for _ in range(200):
        gaps: list[Gap] = []
        for last in np.sort(rng.integers(1000, 5000, 4)):
            gaps += outage(replace(KEPT, gaps=gaps), ten_at(int(last)))
        ranges = (range(gap.first_index, gap.first_index + gap.n_samples) for gap in gaps)
        covered = [i for indices in ranges for i in indices]
        assert sorted(covered) == list(range(1000, int(last)))


def test_a_device_that_counts_anew_leaves_an_estimate_and_what_it_has_counted():
    anew = ten_at(0, epoch=8, shift_s=60.0)

    assert outage(KEPT, anew) == [
        Gap(7, 1000, 5000, anew.start_ns, time_ns(1000), is_estimated=True)
    ]

    anew = ten_at(250, epoch=8, shift_s=60.0)
    begin_ns = T0 + 60_000_000_000

    assert outage(KEPT, anew) == [
        Gap(7, 1000, 5000, begin_ns, time_ns(1000), is_estimated=True),
        Gap(8, 0, 250, anew.start_ns, begin_ns),
    ]


def test_a_count_that_time_or_the_clock_contradicts_is_not_believed():
    """As of a source that begins at zero with every start of the service, in the same epoch."""
    anew = ten_at(0, epoch=7, shift_s=3600.0)

    [gap] = outage(KEPT, anew)

    assert (gap.is_estimated, gap.n_samples) == (True, 359_000)
    assert (gap.start_ns, gap.stop_ns) == (time_ns(1000), anew.start_ns)

    [gap] = outage(KEPT, ten_at(5000, epoch=8, shift_s=-3600.0))

    assert (gap.is_estimated, gap.n_samples) == (True, 0)
    assert gap.start_ns == gap.stop_ns


def test_killed_again_before_a_result_an_estimated_outage_goes_on_where_it_ended():
    first = outage(KEPT, ten_at(0, epoch=8, shift_s=60.0))
    second = outage(replace(KEPT, gaps=first), ten_at(0, epoch=9, shift_s=90.0))

    assert [gap.n_samples for gap in (*first, *second)] == [5000, 3000]
    assert second[0].start_ns == first[0].stop_ns


def test_a_device_that_restarts_under_the_service_leaves_the_time_in_which_it_was_away():
    lost = restart(KEPT, ten_at(40, epoch=8, shift_s=60.0))

    assert lost == Gap(7, 1000, 5000, T0 + 60_000_000_000, time_ns(1000), is_estimated=True)
    assert restart(KEPT, ten_at(40, epoch=8, shift_s=10.0)) is None
