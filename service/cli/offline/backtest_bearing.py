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


@dataclass(frozen=True)
class MachineEvent:
    """What makes a new baseline necessary, such as an overhaul.

    Parameters
    ----------
    bearing
        None if it is about all of the unit.
    """

    unit: str
    bearing: str | None
    time_ns: int
    text: str

    def is_about(self, unit: str, bearing: str) -> bool:
        """Whether it makes this bearing's baseline void."""
        return self.unit == unit and self.bearing in (None, bearing)


@dataclass(frozen=True)
class Learning:
    """For how long a baseline is learned.

    Parameters
    ----------
    days
        After the first reading, and after the first behind each event.
    until_ns
        When learning ends the first time, instead; None if after so many days.
    """

    days: float
    until_ns: int | None = None

    def end_ns(self, begin_ns: int, is_first: bool) -> int:
        """When learning ends that begins at some time."""
        if is_first and self.until_ns is not None:
            return self.until_ns
        return begin_ns + round(self.days * DAY_NS)


@dataclass(frozen=True)
class Period:
    """Rows of one bearing under one baseline.

    Parameters
    ----------
    begin, learned, end
        Learned from the rows from `begin` up to `learned`; compared are those up to `end`.
    event
        What it began with; empty for the first.
    """

    version: int
    begin: int
    learned: int
    end: int
    event: str = ""


def periods_of(
    time_ns: TimeArray, events: Sequence[MachineEvent], learning: Learning
) -> list[Period]:
    """Cut the readings of a bearing at its events; periods without readings are left out."""
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
        direction: decide_all(later, settled, direction, run.stiffness(direction), rules.change)
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


def places_of(plant: PlantFile) -> list[Place]:
    """Units and bearings that there are."""
    return [(unit.id, bearing.id) for unit in plant.unit for bearing in unit.bearing]


def rules_of(
    settings: FilmAlarmSettings,
    plant: PlantFile | None,
    learning: Learning,
    events: Sequence[MachineEvent],
    author: str,
    created_ns: int,
    estimator: str,
) -> BackTestRules:
    """Gather what learning and deciding need."""
    return BackTestRules(
        learning=learning,
        change=settings.change.limits(),
        baseline=settings.baseline.settings(settings.reading_h),
        operating=settings.operating.limits(1.0, 1.0),
        rated=_rated(plant) if plant else {},
        bracket_n_per_m=_brackets(plant) if plant else {},
        events=events,
        author=author,
        created_ns=created_ns,
        estimator=estimator,
    )


def _rated(plant: PlantFile) -> dict[str, tuple[float, float]]:
    return {
        unit.id: (unit.rated_speed_rpm, unit.rated_power_mw)
        for unit in plant.unit
        if unit.rated_power_mw is not None
    }


def _brackets(plant: PlantFile) -> dict[Place, float]:
    return {
        (unit.id, bearing.id): bearing.bracket_stiffness_n_per_m
        for unit in plant.unit
        for bearing in unit.bearing
    }
