"""Report of a back-test: units, alarms and changes."""

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
from core.units import NS_PER_S
from service.cli.offline.backtest_bearing import BearingRun, PeriodRun
from service.cli.offline.backtest_causes import UnitCauses
from service.runtime.times import rfc3339


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, use_attribute_docstrings=True)


class ChangeReport(_Part):
    """A change of stiffness with its uncertainty."""

    percent: float
    """Of what the baseline says, under the same condition."""

    u_percent: float
    """Standard uncertainty of that, of a healthy film's mean."""

    time_scale_h: float
    """Running hours that were averaged over."""


class ConditionReport(_Part):
    """What a bearing ran under."""

    state: str
    eccentricity_ratio: float | None
    oil_temperature_c: float | None
    attitude_deg: float | None
    cell: tuple[int, ...] | None
    """Bins of eccentricity ratio, oil temperature and, where it counts, attitude angle."""


class CauseReport(_Part):
    """What an alarm is put down to."""

    cause: str
    reason: str
    film_share: float | None
    u_film_share: float | None


class AlarmReport(_Part):
    """An alarm."""

    unit: str
    bearing: str
    direction: str
    level: str
    """The highest that it reached."""

    begin: str
    danger: str | None
    """When it became a danger."""

    end: str | None
    """When it returned; null if it lasted to the end of readings or the next machine event."""

    baseline_version: int
    raised: ChangeReport
    largest: ChangeReport
    condition: ConditionReport
    """When it was raised."""

    cause: CauseReport
    """When it was raised."""

    later_cause: CauseReport
    """With the readings of the 24 hours after."""


class SupportReport(_Part):
    """What a baseline knows."""

    version: int
    event: str
    """Machine event that it began with; empty for the first."""

    learned_from: str
    learned_until: str
    """End of the readings that were learned from, this one not included."""

    is_learned: bool
    """False if there were too few readings."""

    cells_own: int
    cells_borrowed: int
    cells_without_support: int
    scatter_percent: float | None
    """Of single readings about what was learned."""

    rejected_percent: float | None
    """Of what was learned from, that fitted too badly to count."""


class FilmReport(_Part):
    """One bearing in one direction."""

    unit: str
    bearing: str
    direction: str
    rows: int
    """Of the file."""

    learning: int
    """Readings of learning periods; the others are counted by verdict."""

    verdicts: dict[str, int]
    judged_percent: float | None
    """Of the settled readings after learning, those that were called normal, alert or danger."""

    n_alarms: int
    baselines: list[SupportReport]


class RateReport(_Part):
    """How often it alarmed: on a healthy plant, the rate of false alarms."""

    unit_years: float
    """From the end of learning to the end of readings, all units together."""

    n_alarms: int
    n_danger: int
    alarms_per_unit_year: float | None


class BackTestReport(_Part):
    """All of it."""

    file: str
    rows: int
    films: list[FilmReport]
    alarms: list[AlarmReport]
    rate: RateReport
    doubts: list[str]
    duration_s: float
    readings_per_s: float


@dataclass(frozen=True)
class Change:
    """A mean deviation, as it was found at one reading.

    Parameters
    ----------
    row
        Of the decision.
    change, std
        ln of what was measured over what was learned, and the standard uncertainty of its mean.
    """

    row: int
    change: float
    std: float
    time_scale_h: float


@dataclass(frozen=True)
class AlarmStretch:
    """An alarm; rows are those of the decision.

    Parameters
    ----------
    end
        First row without it; None if it lasts.
    level
        The highest that it reached.
    danger
        First row of danger, if it came to that.
    raised, largest
        Change when it was raised, and the largest while it lasted.
    """

    begin: int
    end: int | None
    level: AlarmLevel
    danger: int | None
    raised: Change
    largest: Change


def alarm_stretches(decided: DecisionHistory) -> Iterator[AlarmStretch]:
    """Find all alarms, in order of time."""
    is_active = np.concatenate([[False], decided.level > 0, [False]])
    edges = np.flatnonzero(np.diff(is_active.astype(np.int8)))
    for begin, end in edges.reshape(-1, 2).tolist():
        level = decided.level[begin:end]
        dangers = np.flatnonzero(level == AlarmLevel.DANGER)
        largest = begin + int(np.nanargmax(np.abs(decided.change[begin:end])))
        yield AlarmStretch(
            begin=begin,
            end=end if end < decided.level.size else None,
            level=AlarmLevel(int(level.max())),
            danger=begin + int(dangers[0]) if dangers.size else None,
            raised=_change(decided, begin),
            largest=_change(decided, largest),
        )


def _change(decided: DecisionHistory, row: int) -> Change:
    change = float(decided.change[row])
    significance = float(decided.significance[row])
    return Change(row, change, abs(change) / significance, float(decided.time_scale_h[row]))


LATER_NS = 24 * 3600 * NS_PER_S
"""After an alarm, when its cause is looked at again."""


def alarm_reports(runs: Sequence[BearingRun], causes: UnitCauses) -> Iterator[AlarmReport]:
    """All alarms of a unit."""
    for run in runs:
        for period in run.periods:
            for direction, decided in period.decided.items():
                for found in alarm_stretches(decided):
                    yield _alarm(run, period, direction, found, causes)


def film_reports(run: BearingRun) -> Iterator[FilmReport]:
    """Both directions of a bearing."""
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
    time_ns = run.rows.history.time_ns[period.period.learned : period.period.end]
    begin_ns = int(time_ns[found.begin])
    return AlarmReport(
        unit=unit,
        bearing=bearing,
        direction=direction,
        level=found.level.name.lower(),
        begin=rfc3339(begin_ns),
        danger=None if found.danger is None else rfc3339(int(time_ns[found.danger])),
        end=None if found.end is None else rfc3339(int(time_ns[found.end])),
        baseline_version=period.period.version,
        raised=_change_report(found.raised),
        largest=_change_report(found.largest),
        condition=_condition(run, period.period.learned + found.begin, period.stiffness(direction)),
        cause=_cause(causes.of(bearing, direction, begin_ns)),
        later_cause=_cause(
            causes.of(bearing, direction, min(begin_ns + LATER_NS, int(time_ns[-1])))
        ),
    )


def _change_report(found: Change) -> ChangeReport:
    share = float(np.exp(found.change))
    return ChangeReport(
        percent=100.0 * (share - 1.0),
        u_percent=100.0 * share * found.std,
        time_scale_h=found.time_scale_h,
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
