"""Recomputation of operating states and decisions from stored readings, for tests and restarts."""

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import repeat

import numpy as np

from core.arrays import BoolArray, FloatArray, TimeArray
from core.baseline.baseline import QuantityBaseline
from core.baseline.history import CodeArray, StiffnessHistory
from core.change.decision import INITIAL_DECISION, Decision, outcomes, step
from core.change.settings import ChangeLimits, FilmRules
from core.condition.operating_state import (
    NOT_AT_SPEED,
    UNKNOWN_OPERATION,
    OilSettling,
    OperatingLimits,
    OperatingState,
    Operation,
    step_operation,
)


@dataclass(frozen=True, eq=False)
class OperationHistory:
    """Operating state at each reading (n,), and whether the unit was settled in this state (n,)."""

    state: CodeArray
    is_settled: BoolArray


def operation_history(
    time_ns: TimeArray,
    speed_rpm: FloatArray,
    power_mw: FloatArray,
    limits: OperatingLimits,
    oil_temperature_c: FloatArray | None = None,
    state: CodeArray | None = None,
) -> OperationHistory:
    """Return the operating state at each reading and whether it was settled.

    The states are computed from speed and power, unless `state` is given. All arrays are (n,), in
    order of time, with NaN for missing values. Without an oil temperature, the unit counts as warm
    only after the full warm-up time.
    """
    columns = (speed_rpm, power_mw, oil_temperature_c, state)
    rows = [
        (int(operation.state), operation.is_settled(limits, oil.has_settled))
        for operation, oil in _operations(time_ns.tolist(), *columns, limits)
    ]
    states, is_settled = np.array(rows, np.int8).reshape(-1, 2).T
    return OperationHistory(states, is_settled.astype(np.bool_))


def last_operation(history: StiffnessHistory, rules: FilmRules) -> tuple[Operation, OilSettling]:
    """Return the operation of a unit and the oil settling of a bearing after the last reading.

    Without readings, the operation is unknown and the unit is not at speed.
    """
    time_ns = history.time_ns.tolist()
    if time_ns:
        # intervals between stored readings stay unscaled; a time lapse applies only from now on
        shift_ns = rules.lapsed_ns(time_ns[-1]) - time_ns[-1]
        time_ns = [reading_ns + shift_ns for reading_ns in time_ns]
    columns = (history.speed_rpm, history.power_mw, history.oil_temperature_c, None)
    found = deque(_operations(time_ns, *columns, rules.operating), maxlen=1)
    return found[0] if found else (UNKNOWN_OPERATION, NOT_AT_SPEED)


def _operations(
    time_ns: Iterable[int],
    speed_rpm: FloatArray,
    power_mw: FloatArray,
    oil_temperature_c: FloatArray | None,
    state: CodeArray | None,
    limits: OperatingLimits,
) -> Iterator[tuple[Operation, OilSettling]]:
    """Yield the operation and the oil settling after each reading."""
    operation, oil = UNKNOWN_OPERATION, NOT_AT_SPEED
    oils_c = repeat(math.nan) if oil_temperature_c is None else oil_temperature_c.tolist()
    states = repeat(None) if state is None else map(OperatingState, state.tolist())
    rows = zip(time_ns, speed_rpm.tolist(), power_mw.tolist(), states, oils_c, strict=False)
    for now_ns, rpm, mw, given, oil_c in rows:
        operation = step_operation(operation, now_ns, rpm, mw, limits, given)
        oil = oil.step(operation, oil_c, limits)
        yield operation, oil


@dataclass(frozen=True, eq=False)
class DecisionHistory:
    """Decision on a quantity of a film after each reading, as columns (n,).

    `verdict` contains values of `Verdict`, and `level` values of `AlarmLevel`, or 0 for no alarm.
    `change` is the mean deviation from the baseline, in ln, over the averaging time `time_scale_h`
    for which its `significance` is largest; NaN before the first averaging time has elapsed.
    """

    verdict: CodeArray
    level: CodeArray
    change: FloatArray
    significance: FloatArray
    time_scale_h: FloatArray


def decide_all(
    history: StiffnessHistory,
    is_settled: BoolArray,
    quantity: str,
    baseline: QuantityBaseline | None,
    limits: ChangeLimits,
) -> DecisionHistory:
    """Return the decision after each stored reading, from the initial decision on.

    Readings that the mask `is_settled` (n,) excludes are not judged. Without a baseline, no reading
    is judged.
    """
    nothing = (np.nan, np.nan, np.nan)
    rows = [
        (
            *(decision.verdict, decision.level or 0),
            *((f.change, f.significance, f.time_scale_h) if (f := decision.finding) else nothing),
        )
        for decision in _decisions(history, is_settled, quantity, baseline, limits)
    ]
    verdict, level, *finding = np.array(rows, np.float64).reshape(-1, 5).T.copy()
    return DecisionHistory(verdict.astype(np.int8), level.astype(np.int8), *finding)


def last_decision(
    history: StiffnessHistory,
    is_settled: BoolArray,
    baseline: QuantityBaseline,
    rules: FilmRules,
) -> Decision:
    """Return the decision after the last stored reading as if `baseline` had always been active.

    Readings that the mask `is_settled` (n,) excludes are not judged. If there are no readings, the
    initial decision is returned.
    """
    watched = (history, is_settled, baseline.quantity, baseline)
    limits = rules.limits(baseline.quantity)
    found = deque(_decisions(*watched, limits, rules.lapsed_ns), maxlen=1)
    return found[0] if found else INITIAL_DECISION


def _decisions(
    history: StiffnessHistory,
    is_settled: BoolArray,
    quantity: str,
    baseline: QuantityBaseline | None,
    limits: ChangeLimits,
    lapsed_ns: Callable[[int], int] = int,
) -> Iterator[Decision]:
    decision = INITIAL_DECISION
    found = outcomes(history.conditions, *history.of(quantity), is_settled, baseline)
    for time_ns, outcome in zip(history.time_ns.tolist(), found, strict=True):
        decision = step(decision, lapsed_ns(time_ns), outcome, baseline, limits)
        yield decision
