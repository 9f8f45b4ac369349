"""From runs to what is reported of one unit."""

from collections.abc import Iterator, Sequence

import numpy as np

from core.arrays import FloatArray
from core.baseline.baseline import QuantityBaseline
from core.baseline.cell_table import Support
from core.baseline.history import DIRECTIONS
from core.change.cause import Attribution
from core.change.decision import JUDGED, Verdict
from core.condition.operating_state import OperatingState
from core.units import NS_PER_S
from service.cli.offline.back_test.alarm_stretches import AlarmStretch, Change, alarm_stretches
from service.cli.offline.back_test.bearing_run import BearingRun, PeriodRun
from service.cli.offline.back_test.causes import UnitCauses
from service.cli.offline.back_test.report import (
    AlarmReport,
    CauseReport,
    ChangeReport,
    ConditionReport,
    FilmReport,
    SupportReport,
)
from service.runtime.times import rfc3339

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
        raised=_change(found.raised),
        largest=_change(found.largest),
        condition=_condition(run, period.period.learned + found.begin, period.stiffness(direction)),
        cause=_cause(causes.of(bearing, direction, begin_ns)),
        later_cause=_cause(
            causes.of(bearing, direction, min(begin_ns + LATER_NS, int(time_ns[-1])))
        ),
    )


def _change(found: Change) -> ChangeReport:
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
