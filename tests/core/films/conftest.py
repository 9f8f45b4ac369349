"""Films as results tell of them, reading by reading."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from core.assessment import Assessment
from core.baseline.baseline import BearingBaseline, Origin
from core.baseline.learning import learn
from core.baseline.settings import BaselineSettings
from core.condition.cells import CellGrid
from core.condition.operating_limits import OperatingLimits
from core.condition.operation_history import operation_history
from core.decision.limits import ChangeLimits
from core.estimators import Estimator
from core.films.film_rules import FilmRules
from core.quality import Reading, Reason, missing
from core.stiffness_history import StiffnessHistory

READING_NS = 600_000_000_000
LEARNING_DAYS = 100
BRACKET_N_PER_M = 1.18e9

Build = Callable[..., Assessment]
Results = Callable[[StiffnessHistory], Iterator[Assessment]]


@pytest.fixture
def rules() -> FilmRules:
    return FilmRules(
        {"UJB": Estimator.DYNAMIC},
        CellGrid(),
        OperatingLimits(92.3, 330.0, warm_up_s=3600.0),
        ChangeLimits(),
        READING_NS,
    )


@pytest.fixture
def results(assessment: Build) -> Results:
    """What a monitor would say of each reading of a history."""

    def say(history: StiffnessHistory) -> Iterator[Assessment]:
        for i in range(len(history)):
            yield assessment(int(history.time_ns[i]), **readings_at(history, i))

    return say


def readings_at(history: StiffnessHistory, i: int) -> dict[str, Reading]:
    oil_c = float(history.oil_temperature_c[i])
    found = {
        "speed_rpm": Reading(float(history.speed_rpm[i])),
        "power_mw": Reading(float(history.power_mw[i])),
        "eccentricity_ratio": Reading(float(history.eccentricity_ratio[i]), u_random=0.003),
        "attitude_angle_deg": Reading(float(history.attitude_deg[i])),
        "oil_temperature_c": Reading(oil_c) if oil_c == oil_c else missing(Reason.OUT_OF_RANGE),
    }
    for row, d in enumerate("xy"):
        k = float(np.exp(history.ln_k[row, i]))
        number = Reading(k, u_random=float(history.u_random[row, i]) * k)
        lost = missing(Reason.INSUFFICIENT_EXCITATION)
        found[f"dynamic_k_{d}{d}_n_per_m"] = number if k == k else lost
        found[f"order1_shaft_{d}_um_pk"] = Reading(float(history.shaft_um_pk[row, i]))
        found[f"order1_bearing_{d}_um_pk"] = Reading(float(history.bearing_um_pk[row, i]))
    return found


@pytest.fixture(scope="session")
def baseline(film_life: Callable[..., StiffnessHistory]) -> BearingBaseline:
    """Learned from the first days of the life of seed 3."""
    history = film_life(3)
    limits = OperatingLimits(92.3, 330.0, warm_up_s=3600.0)
    found = operation_history(history.time_ns, history.speed_rpm, history.power_mw, limits)
    n = learned_rows(history)
    origin = Origin("U1", "UJB", "dynamic", 4, "Ada", int(history.time_ns[n]))
    return learn(history.rows(0, n), found.is_settled[:n], origin, BaselineSettings())


def learned_rows(history: StiffnessHistory) -> int:
    """Readings of the learning period."""
    until_ns = history.time_ns[0] + LEARNING_DAYS * 86_400_000_000_000
    return int(np.searchsorted(history.time_ns, until_ns))


@pytest.fixture(scope="session")
def later() -> Callable[[StiffnessHistory], StiffnessHistory]:
    """What follows the learning period."""
    return lambda history: history.rows(learned_rows(history), len(history))
