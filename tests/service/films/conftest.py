"""Films in a real store, with readings of a made-up machine."""

from collections.abc import Callable

import numpy as np
import pytest

from core.baseline.stiffness_history import Evidence, StiffnessHistory
from core.change.decision import UNDECIDED
from core.change.film_finding import FilmFinding
from core.change.film_judge import FilmNews
from core.change.film_reading import FilmReading, FilmValue
from core.change.operation_history import operation_history
from core.change.verdict import Verdict
from core.condition.cells import BearingCondition
from core.condition.operating_state import OperatingLimits, OperatingState
from core.machine.unit import Estimator
from core.quality import Reason

OPERATING = OperatingLimits(92.3, 330.0, warm_up_s=3600.0)
NOTHING_SAID = FilmFinding(Verdict.NO_BASELINE)


@pytest.fixture
def told() -> Callable[..., list[FilmNews]]:
    """Readings of a history as news, without any verdict."""

    def tell(history: StiffnessHistory, bearing: str = "UJB") -> list[FilmNews]:
        found = operation_history(history.time_ns, history.speed_rpm, history.power_mw, OPERATING)
        return [
            FilmNews(
                reading_at(history, i, bearing, int(found.state[i]), bool(found.is_settled[i])),
                (NOTHING_SAID, NOTHING_SAID),
                (UNDECIDED, UNDECIDED),
            )
            for i in range(len(history))
        ]

    return tell


def reading_at(
    history: StiffnessHistory, i: int, bearing: str, state: int, is_settled: bool
) -> FilmReading:
    x, y = (
        FilmValue(
            float(history.ln_k[row, i]),
            float(history.u_random[row, i]),
            float(history.shaft_um_pk[row, i]),
            float(history.bearing_um_pk[row, i]),
            Evidence.MEASURED if np.isfinite(history.ln_k[row, i]) else Evidence.BAD_QUALITY,
            Reason.OK if np.isfinite(history.ln_k[row, i]) else Reason.LOW_COVERAGE,
        )
        for row in range(2)
    )
    numbers = (
        *("speed_rpm", "power_mw", "eccentricity_ratio", "u_eccentricity"),
        *("attitude_deg", "oil_temperature_c"),
    )
    return FilmReading(
        "U1",
        bearing,
        Estimator.DYNAMIC,
        int(history.time_ns[i]),
        BearingCondition(OperatingState(state), is_settled, None),
        **{name: float(getattr(history, name)[i]) for name in numbers},
        values=(x, y),
    )
