"""One bearing: what is learned in each period, and what is decided after it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

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
from core.change.decision import WatchedReadings
from core.change.settings import ChangeLimits
from core.condition.operating_state import OperatingLimits
from service.cli.offline.back_test.file_columns import ReadingsError
from service.cli.offline.back_test.histories import BearingRows, Place
from service.cli.offline.back_test.periods import Learning, MachineEvent, Period, periods_of
from service.measuring.baseline_learning import drifted

_Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class BackTestRules:
    """By what rules it is learned and decided.

    Parameters
    ----------
    operating
        Shares and times; rated figures are those of `rated`.
    rated
        Speed in r/min and power in MW by unit; needed only where files do not tell states.
    bracket_n_per_m
        Stiffness of brackets, where it is known.
    author, created_ns, estimator
        For the baselines.
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
    estimator: str = "not told"


@dataclass(frozen=True, eq=False)
class PeriodRun:
    """A period with what was learned, and what was decided by direction.

    Parameters
    ----------
    baseline
        None if there was no reading to learn from.
    doubt
        Why the service would leave the baseline to an engineer; empty if it would accept it.
    far
        How many readings are far from what was learned; empty if none are.
    decided
        Rows from `period.learned` on.
    """

    period: Period
    baseline: BearingBaseline | None
    decided: Mapping[str, DecisionHistory]
    doubt: str = ""
    far: str = ""

    def stiffness(self, direction: str) -> QuantityBaseline | None:
        """What was learned of a film."""
        return self.baseline.of(direction) if self.baseline else None


@dataclass(frozen=True, eq=False)
class BearingRun:
    """All of one bearing."""

    place: Place
    rows: BearingRows
    operation: OperationHistory
    periods: Sequence[PeriodRun]


def run_bearing(place: Place, rows: BearingRows, rules: BackTestRules) -> BearingRun:
    """Learn and decide.

    Raises
    ------
    ReadingsError
        If operating states can be neither read nor followed.
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
            f"unit {place[0]}: operating states are not known: give a column state, or columns"
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
        settings = settings_for(history, rules.baseline)
        origin = _origin(place, period, rules)
        baseline = learn(healthy, is_settled[begin:learned], origin, settings)
        limit = rules.change.alert_change
        doubt = drifted(healthy, is_settled[begin:learned], baseline, limit)
        far = far_readings(history.rows(begin, end), is_settled[begin:end], baseline)
    later, settled = history.rows(learned, end), is_settled[learned:end]
    run = PeriodRun(period, baseline, {}, doubt or "", far or "")
    decided = {
        direction: decide_all(
            WatchedReadings.of(later, settled, direction), run.stiffness(direction), rules.change
        )
        for direction in DIRECTIONS
    }
    return replace(run, decided=decided)


def settings_for(history: StiffnessHistory, settings: BaselineSettings) -> BaselineSettings:
    """Without the attitude where it was never measured; with it nothing would be known at all."""
    is_measured = bool(np.isfinite(history.attitude_deg).any())
    return replace(settings, uses_attitude=settings.uses_attitude and is_measured)


def _origin(place: Place, period: Period, rules: BackTestRules) -> Origin:
    return Origin(
        *place, rules.estimator, period.version, rules.author, rules.created_ns, period.event
    )
