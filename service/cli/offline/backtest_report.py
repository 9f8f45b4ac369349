"""Report of a back-test: films, alarms, changes and causes."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ConfigDict

from core.arrays import FloatArray
from core.baseline.baseline import QuantityBaseline
from core.baseline.cell_table import Support
from core.baseline.history import DIRECTIONS
from core.change.backtest import DecisionHistory
from core.change.cause import Attribution
from core.change.decision import JUDGED, Verdict
from core.condition.operating_state import OperatingState
from core.limits import AlarmLevel
from core.units import DAY_NS
from service.cli.offline.backtest_bearing import BearingRun, PeriodRun
from service.cli.offline.backtest_causes import UnitCauses
from service.runtime.times import rfc3339


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, use_attribute_docstrings=True)


class ChangeReport(_Part):
    """Change of a film stiffness from its baseline, with its uncertainty."""

    percent: float
    """Change from the baseline under the same condition."""

    u_percent: float
    """Standard uncertainty of the change if the film is healthy."""

    time_scale_h: float
    """Averaging time, in running hours."""


class ConditionReport(_Part):
    """Operating condition of a bearing; unknown values are null."""

    state: str
    eccentricity_ratio: float | None
    oil_temperature_c: float | None
    attitude_deg: float | None
    cell: tuple[int, ...] | None
    """Bins of eccentricity ratio, oil temperature and, where it is used, attitude angle."""


class CauseReport(_Part):
    """Probable cause of an alarm, with the film's fraction of the change.

    The fraction and its standard uncertainty are null if unknown.
    """

    cause: str
    reason: str
    film_share: float | None
    u_film_share: float | None


class AlarmReport(_Part):
    """Alarm of the back-test, with its largest change and its probable cause.

    Times are UTC, in RFC 3339 format. `direction` is "x" or "y". `raised` is the change when the
    alarm began.
    """

    unit: str
    bearing: str
    direction: str
    level: str
    """Highest level during the alarm."""

    begin: str
    danger: str | None
    """Time of the first danger; null if the alarm stayed at alert."""

    end: str | None
    """Time of return; null if the alarm lasted to the next machine event or the last reading."""

    baseline_version: int
    raised: ChangeReport
    largest: ChangeReport
    condition: ConditionReport
    """Operating condition when the alarm was raised."""

    cause: CauseReport
    """Probable cause when the alarm was raised."""

    later_cause: CauseReport
    """Probable cause, judged with the readings of the following 24 hours."""


class SupportReport(_Part):
    """Baseline of one period: its learning period, scatter, and number of cells by support.

    A cell of operating conditions has own readings, borrows those of neighbours, or has none.
    """

    version: int
    event: str
    """Machine event at the beginning of the period; empty for the first period."""

    learned_from: str
    learned_until: str
    """End of the learning period, exclusive."""

    is_learned: bool
    """False if there were too few readings."""

    cells_own: int
    cells_borrowed: int
    cells_without_support: int
    scatter_percent: float | None
    """Scatter of single readings about the baseline; null if not learned."""

    rejected_percent: float | None
    """Share of readings rejected as outliers while learning; null if not learned."""


class FilmReport(_Part):
    """Counts of the readings and alarms of one bearing in one direction, and its baselines."""

    unit: str
    bearing: str
    direction: str
    rows: int
    """Number of rows of the file."""

    learning: int
    """Number of readings in learning periods; all other readings are counted by verdict."""

    verdicts: dict[str, int]
    judged_percent: float | None
    """Share of normal, alert and danger among the settled readings after learning; null without
    such readings."""

    n_alarms: int
    baselines: list[SupportReport]


class RateReport(_Part):
    """Rate of alarms; on a healthy plant the false-alarm rate.

    It is null if readings were compared for less than a unit-month.
    """

    unit_years: float
    """From the end of learning to the end of readings, all units together."""

    n_alarms: int
    n_danger: int
    alarms_per_unit_year: float | None


class BackTestReport(_Part):
    """Report of the back-test of a file, in the form that ``--json`` prints.

    `doubts` are sentences on doubts about the result; `duration_s` is the run time of the program.
    """

    file: str
    rows: int
    films: list[FilmReport]
    alarms: list[AlarmReport]
    rate: RateReport
    doubts: list[str]
    duration_s: float
    readings_per_s: float


@dataclass(frozen=True)
class AlarmStretch:
    """Range of rows of a decision history in which an alarm is active.

    Parameters
    ----------
    begin
        Index of the first row with the alarm.
    end
        Index of the first row without the alarm; None if the alarm lasts to the last row.
    level
        Highest level.
    danger
        Index of the first row at level danger; None if the alarm stayed at alert.
    largest
        Index of the row with the largest change.
    """

    begin: int
    end: int | None
    level: AlarmLevel
    danger: int | None
    largest: int


def alarm_stretches(decided: DecisionHistory) -> Iterator[AlarmStretch]:
    """Yield all alarms in a history of decisions, in order of time."""
    is_active = np.concatenate([[False], decided.level > 0, [False]])
    edges = np.flatnonzero(np.diff(is_active.astype(np.int8)))
    for begin, end in edges.reshape(-1, 2).tolist():
        level = decided.level[begin:end]
        dangers = np.flatnonzero(level == AlarmLevel.DANGER)
        yield AlarmStretch(
            begin=begin,
            end=end if end < decided.level.size else None,
            level=AlarmLevel(int(level.max())),
            danger=begin + int(dangers[0]) if dangers.size else None,
            largest=begin + int(np.nanargmax(np.abs(decided.change[begin:end]))),
        )


def alarm_reports(runs: Sequence[BearingRun], causes: UnitCauses) -> Iterator[AlarmReport]:
    """Yield a report on each alarm of a unit, by bearing, period and direction."""
    for run in runs:
        for period in run.periods:
            for direction, decided in period.decided.items():
                for found in alarm_stretches(decided):
                    yield _alarm(run, period, direction, found, causes)


def film_reports(run: BearingRun) -> Iterator[FilmReport]:
    """Yield a report on each direction of a bearing."""
    for direction, n_rows in zip(DIRECTIONS, run.rows.n_rows, strict=True):
        counts = np.zeros(len(Verdict), np.int64)
        for period in run.periods:
            counts += np.bincount(period.decided[direction].verdict, minlength=len(Verdict))
        judged = int(counts[list(JUDGED)].sum())
        settled = int(counts.sum() - counts[Verdict.TRANSIENT])
        yield FilmReport(
            unit=run.place[0],
            bearing=run.place[1],
            direction=direction,
            rows=n_rows,
            learning=sum(p.period.learned - p.period.begin for p in run.periods),
            verdicts={verdict.name.lower(): int(counts[verdict]) for verdict in Verdict},
            judged_percent=100.0 * judged / settled if settled else None,
            n_alarms=sum(len(list(alarm_stretches(p.decided[direction]))) for p in run.periods),
            baselines=[_support(run, period, direction) for period in run.periods],
        )


def _alarm(
    run: BearingRun, period: PeriodRun, direction: str, found: AlarmStretch, causes: UnitCauses
) -> AlarmReport:
    unit, bearing = run.place
    learned, decided = period.period.learned, period.decided[direction]
    time_ns = run.rows.history.time_ns[learned : period.period.end].tolist()
    begin_ns = time_ns[found.begin]
    later_ns = min(begin_ns + DAY_NS, time_ns[-1])
    return AlarmReport(
        unit=unit,
        bearing=bearing,
        direction=direction,
        level=found.level.name.lower(),
        begin=rfc3339(begin_ns),
        danger=None if found.danger is None else rfc3339(time_ns[found.danger]),
        end=None if found.end is None else rfc3339(time_ns[found.end]),
        baseline_version=period.period.version,
        raised=change_report(decided, found.begin),
        largest=change_report(decided, found.largest),
        condition=_condition(run, learned + found.begin, period.stiffness(direction)),
        cause=_cause(causes.of(bearing, direction, begin_ns)),
        later_cause=_cause(causes.of(bearing, direction, later_ns)),
    )


def change_report(decided: DecisionHistory, row: int) -> ChangeReport:
    """Return the change at a row with an alarm, in percent of the baseline; `row` is its index."""
    change = float(decided.change[row])
    share, std = float(np.exp(change)), abs(change) / float(decided.significance[row])
    return ChangeReport(
        percent=100.0 * (share - 1.0),
        u_percent=100.0 * share * std,
        time_scale_h=float(decided.time_scale_h[row]),
    )


def _condition(run: BearingRun, row: int, baseline: QuantityBaseline | None) -> ConditionReport:
    here = run.rows.history.conditions.rows(np.array([row]))
    cell = None
    if baseline is not None and baseline.grid.is_known(here)[0]:
        cell = tuple(int(n) for n in baseline.grid.cells(here)[:, 0])
    return ConditionReport(
        state=OperatingState(int(run.operation.state[row])).name.lower(),
        eccentricity_ratio=_known(here.eccentricity_ratio),
        oil_temperature_c=_known(here.oil_temperature_c),
        attitude_deg=_known(here.attitude_deg),
        cell=cell,
    )


def _known(value: FloatArray) -> float | None:
    return float(value[0]) if np.isfinite(value[0]) else None


def _cause(found: Attribution) -> CauseReport:
    return CauseReport(
        cause=found.cause.value,
        reason=found.reason,
        film_share=found.film_share,
        u_film_share=found.film_share_std,
    )


def _support(run: BearingRun, period: PeriodRun, direction: str) -> SupportReport:
    baseline, time_ns = period.stiffness(direction), run.rows.history.time_ns
    support = [cell.support for cell in baseline.table.cells] if baseline else []
    learned = period.period.learned
    until_ns = time_ns[learned] if learned < time_ns.size else time_ns[-1] + 1
    return SupportReport(
        version=period.period.version,
        event=period.period.event,
        learned_from=rfc3339(int(time_ns[period.period.begin])),
        learned_until=rfc3339(int(until_ns)),
        is_learned=baseline is not None,
        cells_own=support.count(Support.OWN),
        cells_borrowed=support.count(Support.BORROWED),
        cells_without_support=support.count(Support.NONE),
        scatter_percent=100.0 * baseline.scatter if baseline else None,
        rejected_percent=100.0 * baseline.rejected_share if baseline else None,
    )
