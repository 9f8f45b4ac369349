"""Where operation and decisions stand after stored readings, to go on from there."""

import numpy as np
import numpy.typing as npt

from core.baseline.baseline import QuantityBaseline
from core.baseline.stiffness_history import DIRECTIONS, Evidence, StiffnessHistory
from core.change.decision import UNDECIDED, Decision
from core.change.decision import advance as decide
from core.change.film_rules import FilmRules
from core.change.reading import WatchedReading
from core.condition.oil_settling import NOT_AT_SPEED, OilSettling
from core.condition.operating_state import NEVER_SEEN, OperatingReading, Operation, advance


def operation_after(history: StiffnessHistory, rules: FilmRules) -> tuple[Operation, OilSettling]:
    """What a unit did at the end of a bearing's history, and whether its oil had settled."""
    operation, oil = NEVER_SEEN, NOT_AT_SPEED
    if not len(history):
        return operation, oil
    # readings keep their distances, though time may be made to pass faster from now on
    shift_ns = rules.lapsed_ns(int(history.time_ns[-1])) - int(history.time_ns[-1])
    for time_ns, speed_rpm, power_mw, oil_c in zip(
        history.time_ns.tolist(),
        history.speed_rpm.tolist(),
        history.power_mw.tolist(),
        history.oil_temperature_c.tolist(),
        strict=True,
    ):
        reading = OperatingReading(time_ns + shift_ns, speed_rpm, power_mw)
        operation = advance(operation, reading, rules.operating)
        oil = oil.step(operation, oil_c, rules.operating)
    return operation, oil


def decision_after(
    history: StiffnessHistory,
    is_settled: npt.NDArray[np.bool_],
    baseline: QuantityBaseline,
    rules: FilmRules,
) -> Decision:
    """What would have been decided over a history if the baseline had been in force.

    Parameters
    ----------
    is_settled : (n,)
    """
    decision, row = UNDECIDED, DIRECTIONS.index(baseline.direction)
    for i in range(len(history)):
        reading = WatchedReading(
            time_ns=rules.lapsed_ns(int(history.time_ns[i])),
            is_settled=bool(is_settled[i]),
            eccentricity_ratio=float(history.eccentricity_ratio[i]),
            oil_temperature_c=float(history.oil_temperature_c[i]),
            attitude_deg=float(history.attitude_deg[i]),
            value=float(history.ln_k[row, i]),
            u_random=float(history.u_random[row, i]),
            evidence=Evidence(int(history.evidence[row, i])),
        )
        decision = decide(decision, reading, baseline, rules.change)
    return decision
