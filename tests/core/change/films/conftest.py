"""Films as results tell of them, reading by reading."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pytest

from core.baseline.baseline import BearingBaseline, Origin
from core.baseline.history import StiffnessHistory
from core.baseline.learning import learn
from core.baseline.settings import BaselineSettings
from core.change.backtest import operation_history
from core.change.film_judge import FilmJudge, FilmNews
from core.change.film_watch import FilmWatch
from core.change.settings import ChangeLimits, FilmRules
from core.condition.cells import CellGrid
from core.condition.operating_state import OperatingLimits
from core.machine.unit import Estimator
from core.monitor.assessment import Assessment
from core.quality import Reading, Reason, missing

READING_NS, DAY_NS = 600_000_000_000, 86_400_000_000_000
LEARNING_DAYS, LATER_DAYS = 100, 10
BRACKETS = {"UJB": 1.18e9}

OPERATING = OperatingLimits(92.3, 330.0, warm_up_s=3600.0)
RULES = FilmRules({"UJB": Estimator.DYNAMIC}, CellGrid(), OPERATING, ChangeLimits(), READING_NS)


@pytest.fixture
def rules() -> FilmRules:
    return RULES


@dataclass(frozen=True)
class Films:
    """A bearing with its baseline, learned from the first days of the life of seed 3."""

    life: Callable[..., StiffnessHistory]
    assessment: Callable[..., Assessment]
    baseline: BearingBaseline

    def later(self, **changes: Callable[..., object]) -> StiffnessHistory:
        """What follows the learning period."""
        history = self.life(3, **changes)
        n = learned_rows(history)
        end_ns = history.time_ns[n] + LATER_DAYS * DAY_NS
        return history.rows(n, int(np.searchsorted(history.time_ns, end_ns)))

    def watch(self, rules: FilmRules = RULES, *, has_baseline: bool = True) -> FilmWatch:
        """A watch that begins anew."""
        judge = FilmJudge(rules, BRACKETS)
        judge.activate_baseline("UJB", self.baseline if has_baseline else None)
        return FilmWatch(rules, judge)

    def results(self, history: StiffnessHistory) -> Iterator[Assessment]:
        """What a monitor would say of each reading of a history."""
        for i in range(len(history)):
            yield self.assessment(int(history.time_ns[i]), **readings_at(history, i))

    def watched(self, history: StiffnessHistory, watch: FilmWatch | None = None) -> list[FilmNews]:
        """What is found of each reading, by a watch that begins anew unless one is given."""
        watch = watch or self.watch()
        return [news for result in self.results(history) for news in watch.take([result])[1]]


@pytest.fixture(scope="session")
def films(film_life, assessment) -> Films:
    history = film_life(3)
    found = operation_history(history.time_ns, history.speed_rpm, history.power_mw, OPERATING)
    n = learned_rows(history)
    origin = Origin("U1", "UJB", "dynamic", 4, "Ada", int(history.time_ns[n]))
    learned = learn(history.rows(0, n), found.is_settled[:n], origin, BaselineSettings())
    return Films(film_life, assessment, learned)


def learned_rows(history: StiffnessHistory) -> int:
    """Readings of the learning period."""
    return int(np.searchsorted(history.time_ns, history.time_ns[0] + LEARNING_DAYS * DAY_NS))


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
