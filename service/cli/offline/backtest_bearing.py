"""Back-test of one bearing: periods, learning and decisions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from core.arrays import TimeArray
from core.baseline.agreement import far_readings
from core.baseline.baseline import BearingBaseline, Origin, QuantityBaseline
from core.baseline.history import DIRECTIONS, StiffnessHistory
from core.baseline.learning import learn
from core.baseline.settings import BaselineSettings
from core.change.backtest import (
    DecisionHistory,
    OperationHistory,
    decide_all,
    operation_history,
)
from core.change.settings import ChangeLimits
from core.condition.operating_state import OperatingLimits
from core.units import DAY_NS
from service.cli.offline.backtest_cells import ReadingsError
from service.cli.offline.backtest_histories import BearingRows, Place
from service.measuring.baseline_learning import drifted
from service.settings.films import FilmAlarmSettings
from service.settings.plant import PlantFile

UNSPECIFIED = "unspecified"
"""Estimator of a baseline if the user names none."""


@dataclass(frozen=True)
class MachineEvent:
    """Event that requires a new baseline, such as an overhaul.

    Parameters
    ----------
    bearing
        Id of the bearing; None for all bearings of the unit.
    time_ns
        Time of the event, ns since 1970 UTC.
    text
        Description of the event, stored with the new baseline.
    """

    unit: str
    bearing: str | None
    time_ns: int
    text: str

    def is_about(self, unit: str, bearing: str) -> bool:
        """Return whether the event invalidates the baseline of the bearing of the unit."""
        return self.unit == unit and self.bearing in (None, bearing)


@dataclass(frozen=True)
class Learning:
    """Length of the learning periods of the baselines.

    Parameters
    ----------
    days
        Days from the first reading, and from the first reading after each event.
    until_ns
        End of the first learning period, ns since 1970 UTC, in place of `days`; None for `days`.
    """

    days: float
    until_ns: int | None = None

    def end_ns(self, begin_ns: int, is_first: bool) -> int:
        """Return the end of the first or a later period that begins at `begin_ns`, ns, 1970 UTC."""
        if is_first and self.until_ns is not None:
            return self.until_ns
        return begin_ns + round(self.days * DAY_NS)


@dataclass(frozen=True)
class Period:
    """Range of rows of a bearing that are used with one baseline.

    Parameters
    ----------
    version
        Number of the baseline, from 1.
    begin, learned, end
        Row indices: the baseline is learned from the rows before `learned`, from `begin` on, and
        compared with the rows from `learned` on, before `end`.
    event
        Machine event at the beginning of the period; empty for the first period.
    """

    version: int
    begin: int
    learned: int
    end: int
    event: str = ""


def periods_of(
    time_ns: TimeArray, events: Sequence[MachineEvent], learning: Learning
) -> list[Period]:
    """Return the periods between events that have readings, in order; `time_ns` (n,) ascends."""
    ordered = sorted(events, key=lambda event: event.time_ns)
    cuts = [0, *(int(np.searchsorted(time_ns, event.time_ns)) for event in ordered), time_ns.size]
    texts = ["", *(event.text for event in ordered)]
    found: list[Period] = []
    for text, begin, end in zip(texts, cuts, cuts[1:], strict=False):
        if begin < end:
            learned_ns = learning.end_ns(int(time_ns[begin]), begin == 0)
            learned = int(np.clip(np.searchsorted(time_ns, learned_ns), begin, end))
            found.append(Period(len(found) + 1, begin, learned, end, text))
    return found


_Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class BackTestRules:
    """Settings of a back-test: learning periods, limits, machine events and machine data.

    Parameters
    ----------
    operating
        Operating limits; `rated` replaces their rated figures.
    rated
        Speed in r/min and power in MW by unit; needed for files without operating states.
    bracket_n_per_m
        Stiffness of each known bracket in N/m, by unit and bearing.
    author, created_ns, estimator
        Author, time (ns since 1970 UTC) and estimator that are stored with the baselines.
    """

    learning: Learning
    change: ChangeLimits = field(default_factory=ChangeLimits)
    baseline: BaselineSettings = field(default_factory=BaselineSettings)
    operating: OperatingLimits = field(default_factory=lambda: OperatingLimits(1.0, 1.0))
    rated: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    bracket_n_per_m: Mapping[Place, float] = field(default_factory=dict)
    events: Sequence[MachineEvent] = ()
    author: str = "back-test"
    created_ns: int = 0
    estimator: str = UNSPECIFIED


@dataclass(frozen=True, eq=False)
class PeriodRun:
    """Period with its baseline and the decisions on its readings, by direction.

    Parameters
    ----------
    baseline
        Baseline of both directions; None without readings to learn from.
    doubt
        Reason why the service would not accept the baseline by itself; empty if it would.
    far
        Text with the number of readings far from the baseline; empty if there are none.
    decided
        Decisions on the rows from `period.learned` on.
    """

    period: Period
    baseline: BearingBaseline | None
    decided: Mapping[str, DecisionHistory]
    doubt: str = ""
    far: str = ""

    def stiffness(self, direction: str) -> QuantityBaseline | None:
        """Return the stiffness baseline of a direction; None without a baseline."""
        return self.baseline.of(f"k_{direction}") if self.baseline else None


@dataclass(frozen=True, eq=False)
class BearingRun:
    """Result of the back-test of one bearing: its readings, operating states and periods.

    `place` is the pair of unit and bearing; `periods` are in order of time, one per baseline.
    """

    place: Place
    rows: BearingRows
    operation: OperationHistory
    periods: Sequence[PeriodRun]


def run_bearing(place: Place, rows: BearingRows, rules: BackTestRules) -> BearingRun:
    """Learn the baselines of one bearing, and compare its later readings with the baselines.

    Raises
    ------
    ReadingsError
        If operating states are neither given nor derivable from speed and power.
    """
    operation = _operation(place, rows, rules)
    events = [event for event in rules.events if event.is_about(*place)]
    periods = periods_of(rows.history.time_ns, events, rules.learning)
    runs = [_run(place, rows.history, operation.is_settled, p, rules) for p in periods]
    return BearingRun(place, rows, operation, runs)


def _operation(place: Place, rows: BearingRows, rules: BackTestRules) -> OperationHistory:
    history, oil_c = rows.history, rows.history.oil_temperature_c
    columns = (history.time_ns, history.speed_rpm, history.power_mw)
    if rows.state is not None:
        return operation_history(*columns, rules.operating, oil_c, rows.state)
    if place[0] not in rules.rated:
        raise ReadingsError(
            f"unit {place[0]}: operating states are unknown; give a column state, or columns"
            " speed_rpm and power_mw and a plant file with the unit's rated speed and power"
        )
    speed_rpm, power_mw = rules.rated[place[0]]
    limits = replace(rules.operating, rated_speed_rpm=speed_rpm, rated_power_mw=power_mw)
    return operation_history(*columns, limits, oil_c)


def _run(
    place: Place,
    history: StiffnessHistory,
    is_settled: _Bools,
    period: Period,
    rules: BackTestRules,
) -> PeriodRun:
    begin, learned, end = period.begin, period.learned, period.end
    baseline, doubt, far = None, None, None
    if learned > begin:
        healthy = history.rows(begin, learned)
        # no cell would be known with an attitude that was never measured
        is_measured = bool(np.isfinite(history.attitude_deg).any())
        uses_attitude = rules.baseline.uses_attitude and is_measured
        settings = replace(rules.baseline, uses_attitude=uses_attitude)
        origin = Origin(
            *(*place, rules.estimator, period.version),
            *(rules.author, rules.created_ns, period.event),
        )
        baseline = learn(healthy, is_settled[begin:learned], origin, settings)
        limit = rules.change.alert_change
        doubt = drifted(healthy, is_settled[begin:learned], baseline, lambda _: limit)
        far = far_readings(history.rows(begin, end), is_settled[begin:end], baseline)
    later, settled = history.rows(learned, end), is_settled[learned:end]
    run = PeriodRun(period, baseline, {}, doubt or "", far or "")
    decided = {
        direction: decide_all(
            *(later, settled, f"k_{direction}", run.stiffness(direction), rules.change)
        )
        for direction in DIRECTIONS
    }
    return replace(run, decided=decided)


def rules_of(
    settings: FilmAlarmSettings,
    plant: PlantFile | None,
    learning: Learning,
    events: Sequence[MachineEvent],
    author: str,
    created_ns: int,
    estimator: str,
) -> BackTestRules:
    """Return the rules of a back-test with the limits of `settings`.

    Rated figures and bracket stiffness are those of `plant`; with None they are unknown. `author`,
    `created_ns` (ns since 1970 UTC) and `estimator` are stored with the baselines.
    """
    units = plant.unit if plant else ()
    return BackTestRules(
        learning=learning,
        change=settings.change.limits(),
        baseline=settings.baseline.settings(settings.reading_h),
        operating=settings.operating.limits(1.0, 1.0),
        rated={
            unit.id: (unit.rated_speed_rpm, unit.rated_power_mw)
            for unit in units
            if unit.rated_power_mw is not None
        },
        bracket_n_per_m={
            (unit.id, bearing.id): bearing.bracket_stiffness_n_per_m
            for unit in units
            for bearing in unit.bearing
            if bearing.bracket_stiffness_n_per_m is not None
        },
        events=events,
        author=author,
        created_ns=created_ns,
        estimator=estimator,
    )
