"""A device that counts anew without telling is told from a block that comes once more, by time."""

from dataclasses import replace

import numpy as np
import pytest
from rigs.blocks import given_block

from core.monitor.assessment import AnalysisSettings
from core.monitor.monitor import UnitMonitor
from core.quality import GOOD
from core.samples.axis import RECOUNTED_EPOCHS
from core.samples.blocks import SampleBlock
from core.samples.gaps import Counts, Gap

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


def test_a_count_that_falls_back_while_time_goes_on_is_another_one(counts: Counts) -> None:
    placed = [counts.placed(at(60 * n, late_s=1700.0)) for n in range(20)]
    [epoch] = {block.epoch for block in placed}
    assert epoch >= RECOUNTED_EPOCHS
    assert [block.first_index for block in placed] == list(range(0, 1200, 60))


@pytest.mark.parametrize(
    "block",
    [at(MILLION), at(MILLION - 60), at(0), at(MILLION - 6000, late_s=0.9), at(0, late_s=-1700.0)],
)
def test_a_block_that_comes_once_more_with_its_own_time_stays_where_it_was(
    counts: Counts, block: SampleBlock
) -> None:
    assert place(counts.placed(block)) == place(block)
    assert counts.placed(at(MILLION + 60)).epoch == 7


def test_what_comes_again_in_the_new_count_is_a_repetition_there(counts: Counts) -> None:
    first, again = (counts.placed(at(0, late_s=1700.0)) for _ in range(2))
    assert place(first) == place(again)
    assert counts.placed(at(60, late_s=1700.0)).epoch == first.epoch
    found = [counts.placed(at(0, late_s=1700.0 + 10.0 * n)).epoch for n in range(5)]
    assert len(set(found)) == 5  # each time that it falls back it is another count


def test_an_epoch_that_the_device_tells_is_taken_as_it_is(counts: Counts) -> None:
    counts.placed(at(0, late_s=1700.0))
    assert counts.placed(at(0, late_s=1800.0, epoch=8)).epoch == 8
    assert counts.placed(at(60, late_s=1800.0, epoch=8)).epoch == 8


def test_another_process_goes_on_in_the_same_count_whatever_its_clock_says(counts: Counts) -> None:
    anew = counts.placed(at(0, late_s=1700.0))
    other = Counts()
    other.restore(counts.count)
    assert place(other.replayed(at(0, late_s=1700.0))) == place(anew)
    following = at(60, late_s=1700.0)
    assert place(other.placed(following)) == place(counts.placed(following))
    counts = Counts()
    counts.placed(at(MILLION))
    counts.placed(at(MILLION + 60, late_s=-3600.0))
    other = Counts()
    other.restore(counts.count)
    assert other.replayed(at(MILLION)).epoch == 7


def test_samples_after_an_untold_restart_are_analysed_and_a_repetition_is_not(unit) -> None:
    """A million samples, then from 0 on: results come again with the first whole segment."""
    settings = AnalysisSettings()
    counts, monitor = Counts(), UnitMonitor(unit, settings)
    monitor.ingest(counts.placed(at(MILLION)))
    found = []
    for index in range(0, settings.segment_samples + 60, 60):
        for _ in range(2):
            found += monitor.ingest(counts.placed(at(index, late_s=1700.0)))
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


def test_a_count_that_wrapped_is_no_gap_of_months(unit) -> None:
    """A reader that began again finds the low bits of a count that was gone on with."""
    counts, monitor = Counts(), UnitMonitor(unit, AnalysisSettings())
    stop = 2**32 + 10 * MILLION
    monitor.ingest(counts.placed(at(stop)))
    found = at(stop + 6060)
    late = replace(found, first_index=found.first_index - 2**32)
    monitor.ingest(counts.placed(late))
    [lost] = monitor.drain_gaps()
    assert (lost.n_samples, lost.is_estimated) == (6000, True)
    assert monitor.account.n_gap == 0
