"""What a store holds beside what was offered: lost, altered, unexpected, duplicated, gaps.

The words are those of Jepsen. Everything is read through the store's interface, and every stored
number is computed again from seed, channel, epoch and index by the real monitor.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

from core.samples.gaps import Gap
from harness.alarm_ledger import alarm_faults
from harness.ledger_daq import Offered
from harness.ledger_plant import LedgerPlant
from harness.lives import (
    ALWAYS,
    Replay,
    Rows,
    Run,
    index_of,
    runs_of,
    stored_rows,
    taken,
    uncovered,
)
from harness.watch import Watch
from service.app.storage import open_store
from service.settings.plant import load_plant_file
from service.store.store import Store


@dataclass
class Findings:
    """What is wrong; nothing is, if all lists are empty. The counts are for the table.

    Parameters
    ----------
    lost
        Shown to a client as stored, and not there.
    altered
        There with other values than the samples lead to.
    unexpected
        There, and never offered; or of samples that a gap says were missing.
    duplicated
        There twice.
    missing
        Results that the samples which were taken must have led to, before later ones did.
    gaps
        Samples that are neither in a result nor in a gap, in two gaps, or in both.
    alarms
        Events that should be there and are not, or are there twice, or have no letter.
    """

    lost: list[str] = field(default_factory=list)
    altered: list[str] = field(default_factory=list)
    unexpected: list[str] = field(default_factory=list)
    duplicated: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    gaps: list[str] = field(default_factory=list)
    alarms: list[str] = field(default_factory=list)
    n_offered: int = 0
    n_in_results: int = 0
    n_in_gaps: int = 0
    n_without_result: int = 0
    n_results: int = 0
    n_shown: int = 0
    n_promised: int = 0
    n_exceedances: int = 0

    @property
    def wrong(self) -> dict[str, list[str]]:
        """What is wrong, the first of each kind."""
        return {name: v[:5] for name, v in vars(self).items() if isinstance(v, list) and v}

    @property
    def counts(self) -> dict[str, int]:
        """How much there was of everything."""
        return {name: len(v) if isinstance(v, list) else v for name, v in vars(self).items()}


@dataclass(frozen=True)
class Case:
    """A store that no service writes to, what it is compared with, and what is found."""

    plant: LedgerPlant
    store: Store
    offered: Offered
    watch: Watch
    found: Findings

    def index_of(self, time_ns: int) -> int:
        """Index of the sample that begins at a time."""
        return index_of(time_ns, self.offered.t0_ns, self.plant.rate_hz)


def check(
    plant: LedgerPlant,
    plant_file: Path,
    offered: Offered,
    lives: Mapping[str, Sequence[int]],
    watch: Watch,
    units: Sequence[str] = (),
) -> Findings:
    """Compare the store of a service that does not run with the truth.

    Parameters
    ----------
    lives
        For each unit, the number of the newest sample offered as each process was started.
    watch
        What a client was shown.
    units
        Those that are looked at; all of them unless given.
    """
    file = load_plant_file(plant_file)
    with closing(open_store(file)) as store:
        case = Case(plant, store, offered, watch, Findings())
        rows = {unit: stored_rows(store, unit) for unit in units or plant.units}
        for unit, its in rows.items():
            replay = Replay(plant, file, unit, offered.t0_ns)
            _check_unit(case, unit, its, lives[unit], replay)
        alarm_faults(case, rows)
    return case.found


def _check_unit(case: Case, unit: str, rows: Rows, lives: Sequence[int], replay: Replay) -> None:
    index = {key: case.index_of(key[1]) for key in rows}
    runs = runs_of(index.values(), case.plant, lives)
    case.found.n_offered += case.offered.samples[unit, 1]
    case.found.n_results += len(rows)
    _check_shown(case, unit, rows, index)
    gaps = sorted(case.store.gaps(unit, *ALWAYS), key=lambda gap: gap.first_index)
    _check_values(case.found, unit, rows, replay, taken(runs, gaps))
    _check_gaps(case, unit, gaps, runs)


def _check_shown(case: Case, unit: str, rows: Rows, index: Mapping[tuple[str, int], int]) -> None:
    found = case.found
    there = {(bearing, time_ns // 1_000_000): (bearing, time_ns) for bearing, time_ns in rows}
    repeated = Counter((key[0], n) for key, n in index.items())
    found.duplicated += [f"{unit} {key}" for key, n in repeated.items() if n > 1]
    for (shown_unit, bearing), values in case.watch.shown.items():
        if shown_unit != unit:
            continue
        found.n_shown += len(values)
        for time_ms, value in values.items():
            key = there.get((bearing, time_ms))
            if key is None and value is None:
                found.n_shown -= 1  # where a trend breaks off: no result
            elif key is None:
                found.lost.append(f"{unit} {bearing} at {time_ms} ms")
            elif rows[key]["order1_shaft_x_um_pk"][0] != value:
                found.altered.append(f"{unit} {bearing} at {time_ms} ms: shown as {value}")


def _check_values(
    found: Findings, unit: str, rows: Rows, replay: Replay, runs: Sequence[Run]
) -> None:
    left = dict(rows)
    for assessment in replay.results(runs):
        key = (assessment.bearing, assessment.time_ns)
        row = left.pop(key, None)
        if row is None:
            found.missing.append(f"{unit} {key}")
            continue
        for name, reading in assessment.readings.items():
            value, level = row[name]
            if value != reading.value or level != reading.quality.level:
                found.altered.append(
                    f"{unit} {key} {name}: {value} {level}, not {reading.value} {reading.quality}"
                )
                break
    found.unexpected += [f"{unit} {key}" for key in left]


def _check_gaps(case: Case, unit: str, gaps: Sequence[Gap], runs: Sequence[Run]) -> None:
    """Between two runs everything is in a gap, but what was taken and led to no result.

    Samples that were taken between two gaps, or before one, may not suffice for a result.
    """
    found, plant = case.found, case.plant
    found.n_in_results += sum(run.stop - run.start for run in runs)
    found.n_in_gaps += sum(gap.n_samples for gap in gaps)
    for before, gap in pairwise(gaps):
        if before.first_index + before.n_samples > gap.first_index:
            found.gaps.append(f"{unit}: {before} and {gap} tell of the same samples")
    for gap in gaps:
        stop = gap.first_index + gap.n_samples
        if stop > case.offered.samples[unit, 1]:
            found.gaps.append(f"{unit}: {gap} is of samples that were never offered")
        if any(run.start < stop and gap.first_index < run.stop for run in runs):
            found.gaps.append(f"{unit}: {gap} is of samples that led to results")
    ends = {gap.first_index + gap.n_samples for gap in gaps}
    begins = {gap.first_index for gap in gaps}
    for run, after in pairwise(runs):
        left = uncovered(gaps, run.stop, after.start)
        found.n_without_result += sum(stop - start for start, stop in left)
        # what was taken since the last result is lost with a process, and kept without a stop
        allowed = {*ends, *([run.stop] if run.life == after.life else [])}
        # after a start, the first segment begins up to a hop after the first sample
        stops = begins | ({after.start} if run.life != after.life else set())
        for start, stop in left:
            is_short = start == run.stop or stop == after.start
            least = plant.hop_samples if is_short else plant.segment_samples
            if start not in allowed or stop not in stops or stop - start >= least:
                told = f"{start} to {stop} between {run} and {after}"
                found.gaps.append(f"{unit}: nothing tells of {told}")
