"""How far a quantity has moved on one time scale: what attribution looks at."""

import numpy as np
import numpy.typing as npt

from core.baseline.baseline import BearingBaseline, QuantityBaseline, Watched
from core.baseline.watched import watched_values
from core.condition.film_conditions import FilmConditions
from core.decision.attribution import Movement, Movements
from core.decision.decision import Decision
from core.decision.finding_history import finding_history
from core.stiffness_history import StiffnessHistory

SPANS = 6.0
"""Time scales that are looked back: what lies further has a weight of a four-hundredth."""


def movement_of(
    decision: Decision, baseline: QuantityBaseline, time_scale_h: float
) -> Movement | None:
    """How far a quantity has moved, from a decision that is led on reading by reading."""
    if not decision.evidence.scales:
        return None
    for finding in decision.evidence.findings(baseline):
        if finding.time_scale_h == time_scale_h:
            return Movement(finding.change, finding.std)
    return None


def movements_at(
    history: StiffnessHistory,
    is_settled: npt.NDArray[np.bool_],
    baseline: BearingBaseline,
    direction: str,
    time_scale_h: float,
) -> Movements:
    """How far the quantities of one direction have moved at the end of a history."""
    stiffness, shaft, bearing = (
        _movement_at(history, is_settled, baseline.of(quantity, direction), time_scale_h)
        for quantity in (Watched.STIFFNESS, Watched.SHAFT, Watched.BEARING)
    )
    return Movements(stiffness, shaft, bearing)


def _movement_at(
    history: StiffnessHistory,
    is_settled: npt.NDArray[np.bool_],
    baseline: QuantityBaseline | None,
    time_scale_h: float,
) -> Movement | None:
    if baseline is None:
        return None
    start = max(0, len(history) - 4 * int(SPANS * time_scale_h / baseline.reading_h))
    history, is_settled = history.rows(start, len(history)), is_settled[start:]
    value, u_random = watched_values(history, baseline.quantity, baseline.direction)
    found = baseline.compare(FilmConditions.of(history), value, u_random)
    counted = np.flatnonzero(is_settled & (found.place >= 0))
    counted = counted[-int(SPANS * time_scale_h / baseline.reading_h) :]
    findings = finding_history(found, counted, baseline)
    scale = np.flatnonzero(findings.time_scales_h == time_scale_h)
    if not (scale.size and counted.size) or findings.significance[scale[0], -1] <= 0.0:
        return None
    change = float(findings.change[scale[0], -1])
    return Movement(change, abs(change) / float(findings.significance[scale[0], -1]))
