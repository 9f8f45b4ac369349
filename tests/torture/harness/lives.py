"""What the service must have found in the samples that it got, computed again by its own monitor.

A *run* is what it took without a hole: its first result tells where it began. A *life* is the time
from one start of the process to its end; a monitor lives as long, and averages over the gaps in it.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from core.monitor.assessment import Assessment
from core.monitor.catalogue import CATALOGUE
from core.monitor.monitor import UnitMonitor
from core.samples.blocks import SampleBlock
from core.samples.calibration import UnitCalibration
from core.samples.gaps import Gap
from harness.ledger_plant import LedgerFeed, LedgerPlant
from harness.truth import BEARINGS
from service.settings.core_values import analysis_of, calibration_of, machine_of
from service.settings.plant import PlantFile
from service.store.port import TrendQuery
from service.store.store import Store

NS_PER_S = 1_000_000_000
ALWAYS = (0, 2**62)
PAGE = 5000
NAMES = tuple(quantity.name for quantity in CATALOGUE)
NAMES_AT_ONCE = 40

Value = tuple[float | None, object]
"""Mean and level of a quantity, as the store tells them."""

Rows = dict[tuple[str, int], dict[str, Value]]
"""By bearing and time, by quantity."""


@dataclass(frozen=True)
class Run:
    """Samples that were taken without a hole, as far as they have led to results.

    Parameters
    ----------
    life
        Number of the process, from 0.
    """

    life: int
    start: int
    stop: int


def stored_rows(store: Store, unit: str) -> Rows:
    """Every stored result of a unit, by the store's own interface."""
    rows: Rows = {}
    for bearing in BEARINGS:
        for first in range(0, len(NAMES), NAMES_AT_ONCE):
            names = NAMES[first : first + NAMES_AT_ONCE]
            for time_ns, values in _pages(store, unit, bearing, names):
                rows.setdefault((bearing, time_ns), {}).update(values)
    return rows


def _pages(
    store: Store, unit: str, bearing: str, names: tuple[str, ...]
) -> Iterator[tuple[int, Mapping[str, Value]]]:
    start_ns: int | None = 0
    while start_ns is not None:
        query = TrendQuery(unit, bearing, names, start_ns, ALWAYS[1], PAGE, 2**62, is_page=True)
        trend = store.trend(query)
        for row, time_ns in enumerate(trend.time_ns):
            yield (
                int(time_ns),
                {n: (trend.series[n].mean[row], trend.series[n].worst_level[row]) for n in names},
            )
        start_ns = trend.next_ns


def index_of(time_ns: int, t0_ns: int, rate_hz: float) -> int:
    """Number of the sample that begins at a time."""
    return round((time_ns - t0_ns) * rate_hz / NS_PER_S)


def runs_of(stops: Iterable[int], plant: LedgerPlant, lives: Sequence[int]) -> list[Run]:
    """Runs by the ends of the segments that have led to results.

    Parameters
    ----------
    lives
        Number of the newest sample offered as each process was started.
    """
    runs: list[Run] = []
    for stop in sorted(set(stops)):
        life = max((n for n, born in enumerate(lives) if born < stop), default=0)
        if runs and stop == runs[-1].stop + plant.hop_samples and life == runs[-1].life:
            runs[-1] = Run(life, runs[-1].start, stop)
        else:
            runs.append(Run(life, stop - plant.segment_samples, stop))
    return runs


class Replay:
    """A unit's monitor, fed anew with what the service got."""

    def __init__(self, plant: LedgerPlant, file: PlantFile, unit: str, t0_ns: int) -> None:
        settings = next(one for one in file.unit if one.id == unit)
        self._machine, self._analysis = machine_of(settings), analysis_of(file.analysis)
        self._calibration: UnitCalibration = calibration_of(settings)
        self._plant, self._number, self._t0_ns = plant, plant.units.index(unit) + 1, t0_ns

    def results(self, runs: Sequence[Run], epoch: int = 1) -> Iterator[Assessment]:
        """All results of these runs, one life after the other."""
        monitor, life = None, -1
        for run in runs:
            if monitor is None or run.life != life:
                monitor, life = UnitMonitor(self._machine, self._analysis), run.life
                monitor.go_on(None, run.start % self._plant.slot_samples)
            for raw in self._slots(run, epoch):
                yield from monitor.steps(replace(raw, calibration=self._calibration))

    def _slots(self, run: Run, epoch: int) -> Iterator[SampleBlock]:
        slot = self._plant.slot_samples
        start = run.start - run.start % slot  # blocks of the device
        feed = LedgerFeed(self._plant, self._number, self._t0_ns, epoch, start)
        for _ in range(start, run.stop, slot):
            yield feed.advance(slot)


def uncovered(gaps: Sequence[Gap], start: int, stop: int) -> list[tuple[int, int]]:
    """What of a stretch of samples no gap tells of."""
    left = [(start, stop)] if start < stop else []
    for gap in gaps:
        low, high = gap.first_index, gap.first_index + gap.n_samples
        left = [
            part
            for a, b in left
            for part in ((a, min(b, low)), (max(a, high), b))
            if part[0] < part[1]
        ]
    return left


def taken(runs: Sequence[Run], gaps: Sequence[Gap]) -> list[Run]:
    """Runs, and what did not suffice for a result, without what precedes a first segment."""
    ends = {gap.first_index + gap.n_samples for gap in gaps}
    short = [
        Run(after.life, start, stop)
        for run, after in pairwise(runs)
        for start, stop in uncovered(gaps, run.stop, after.start)
        if start in ends and (run.life == after.life or stop != after.start)
    ]
    return sorted([*runs, *short], key=lambda run: run.start)
