"""A baseline to decide by, and decisions led on reading by reading."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pytest

from core.baseline.baseline import BearingBaseline, Origin, QuantityBaseline, Watched
from core.baseline.learning import learn
from core.baseline.settings import BaselineSettings
from core.condition.operating_limits import OperatingLimits
from core.condition.operation_history import operation_history
from core.decision.decision import UNDECIDED, Decision, advance
from core.decision.limits import ChangeLimits
from core.decision.reading import WatchedReading
from core.stiffness_history import Evidence, StiffnessHistory

DAY_NS = 86_400_000_000_000
LEARNING_DAYS = 120


@dataclass(frozen=True)
class Watch:
    """A history that a baseline was learned from, and what came later."""

    baseline: BearingBaseline
    later: StiffnessHistory
    is_settled: npt.NDArray[np.bool_]

    @property
    def stiffness_x(self) -> QuantityBaseline:
        found = self.baseline.of(Watched.STIFFNESS, "x")
        assert found is not None
        return found


def settled(history: StiffnessHistory) -> npt.NDArray[np.bool_]:
    limits = OperatingLimits(92.3, 330.0, warm_up_s=3600.0)
    states = operation_history(history.time_ns, history.speed_rpm, history.power_mw, limits)
    return states.is_settled


@pytest.fixture(scope="session")
def watch() -> Callable[..., Watch]:
    """Learn from the first days of a history; the rest is for deciding."""
    learned: dict[bytes, BearingBaseline] = {}

    def begin(history: StiffnessHistory, watched: tuple[Watched, ...]) -> Watch:
        until_ns = history.time_ns[0] + LEARNING_DAYS * DAY_NS
        n = int(np.searchsorted(history.time_ns, until_ns))
        is_settled = settled(history)
        key = history.ln_k[:, :n].tobytes() + str(watched).encode()
        if key not in learned:
            origin = Origin("U1", "UJB", "dynamic", 1, "Ada", int(until_ns))
            learned[key] = learn(
                history.rows(0, n), is_settled[:n], origin, BaselineSettings(), watched
            )
        return Watch(learned[key], history.rows(n, len(history)), is_settled[n:])

    return begin


@pytest.fixture(scope="session")
def step_by_step() -> Callable[..., list[Decision]]:
    """Decide reading by reading."""

    def decide(
        history: StiffnessHistory,
        is_settled: npt.NDArray[np.bool_],
        baseline: QuantityBaseline | None,
        limits: ChangeLimits,
        begin: Decision = UNDECIDED,
    ) -> list[Decision]:
        decision, found = begin, []
        for row in range(len(history)):
            reading = WatchedReading(
                time_ns=int(history.time_ns[row]),
                is_settled=bool(is_settled[row]),
                eccentricity_ratio=float(history.eccentricity_ratio[row]),
                oil_temperature_c=float(history.oil_temperature_c[row]),
                attitude_deg=float(history.attitude_deg[row]),
                value=float(history.ln_k[0, row]),
                u_random=float(history.u_random[0, row]),
                evidence=Evidence(int(history.evidence[0, row])),
            )
            decision = advance(decision, reading, baseline, limits)
            found.append(decision)
        return found

    return decide
