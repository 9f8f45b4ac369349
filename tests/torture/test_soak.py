"""Twenty units at five times nominal for a long time: nothing grows, and every account closes."""

import os
from dataclasses import replace

import pytest
from harness.bench import Bench
from harness.ledger_plant import LedgerPlant
from harness.soak import Soaked, soak

LOAD = 5.0
WHOLE = LedgerPlant(n_units=20, load=LOAD, segment_samples=8192, n_segments=24)
SHORT = LedgerPlant(n_units=1, load=LOAD, segment_samples=4096)
MAX_RISE_MIB = 6.0
"""From the warm-up to the end, by the fitted line, however long that is. Blocks that have to wait
raise the mark up to which the heap was ever filled, by some MiB and not for ever; a leak of one
block in a hundred is more in a quarter of an hour."""

MIN_SETTLED_S = 600.0
"""A slope is judged only if the time after the warm-up is at least as long. In a shorter soak the
averaging windows and the bundles of evidence still fill, and a slope says nothing about a leak."""

MAX_MIB, MAX_FILES, MAX_THREADS = 450.0, 100, 40
"""What the service ever takes, however short the soak. It takes about 370 MiB, 45 files and 13
threads after 20 minutes and after 80. In five minutes a leak of one block in five exceeds this, and
so does one file for each of 300 alarms."""

FEW_BUNDLES = "[evidence]\nmax_per_alarm = 3\n"
"""So that the limits of evidence are reached in the warm-up, as in a plant of some years."""

SPARE_FILES = 2
"""Of which it may happen to have more in the second half than ever in the first."""

MOST_IN_GAPS = 0.1
"""Share of the samples, beside the share of time for which other programs kept the service from a
processor: a ring holds 1.6 s, and a service that is held up for longer has to lose the samples."""

POOL_THREADS = (os.cpu_count() or 1) + 4
"""Of asyncio's own pool, which makes one more whenever more are wanted at once than ever before."""


@pytest.fixture
def plant(torture_seed: int, is_whole: bool) -> LedgerPlant:
    return replace(WHOLE if is_whole else SHORT, seed=torture_seed)


@pytest.mark.long
@pytest.mark.timeout(9000)
def test_a_long_time_under_load_leaves_everything_as_it_was(plant, daq, tmp_path, soak_s, torture):
    with Bench(plant, daq, tmp_path, FEW_BUNDLES, period_s=1.0) as bench:
        done = soak(bench, soak_s, plant.units[:2])
    torture.figure(f"soak\n{done.table(plant)}")
    assert done.findings.wrong == {}
    assert done.findings.n_results > 0
    assert done.open_accounts == []
    assert done.silent_healthy_s == 0.0
    if torture.is_whole:
        assert_nothing_grows(done)


def assert_nothing_grows(done: Soaked) -> None:
    assert done.most("memory_mib") <= MAX_MIB
    assert done.most("n_files") <= MAX_FILES
    assert done.most("n_threads") <= MAX_THREADS
    settled_s = done.settled[-1].at_s - done.settled[0].at_s
    if settled_s >= MIN_SETTLED_S:
        memory = done.growth("memory_mib")
        assert memory.per_hour * settled_s / 3600.0 <= MAX_RISE_MIB, str(memory)
        assert done.rise("n_files") <= SPARE_FILES
        assert done.rise("n_threads") <= POOL_THREADS
    assert done.n_gap <= (MOST_IN_GAPS + done.waiting_share) * done.n_offered
