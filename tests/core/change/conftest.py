"""A baseline to decide by, and decisions led on reading by reading."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import pytest

from core.baseline.baseline import Origin, QuantityBaseline, Watched
from core.baseline.learning import learn
from core.baseline.settings import BaselineSettings
from core.baseline.stiffness_history import Evidence, StiffnessHistory
from core.change.back_test import DecisionHistory, back_test
from core.change.decision import UNDECIDED, Decision, advance
from core.change.operation_history import operation_history
from core.change.reading import WatchedReading
from core.change.settings import ChangeLimits
from core.condition.operating_state import OperatingLimits

DAY_NS = 86_400_000_000_000
LEARNING_DAYS = 120
LIMITS = ChangeLimits()


@dataclass(frozen=True)
class Watch:
    """What a baseline was learned from, and what came later: the stiffness in x is decided."""

    baseline: QuantityBaseline
    later: StiffnessHistory
    is_settled: npt.NDArray[np.bool_]

    def whole(self, limits: ChangeLimits = LIMITS) -> DecisionHistory:
        """Decide over all that came later at once."""
        return back_test(self.later, self.is_settled, self.baseline, limits)

    def steps(self, limits: ChangeLimits = LIMITS, begin: Decision = UNDECIDED) -> list[Decision]:
        """Decide reading by reading."""
        found, history = [begin], self.later
        for row in range(len(history)):
            reading = WatchedReading(
                time_ns=int(history.time_ns[row]),
                is_settled=bool(self.is_settled[row]),
                eccentricity_ratio=float(history.eccentricity_ratio[row]),
                oil_temperature_c=float(history.oil_temperature_c[row]),
                attitude_deg=float(history.attitude_deg[row]),
                value=float(history.ln_k[0, row]),
                u_random=float(history.u_random[0, row]),
                evidence=Evidence(int(history.evidence[0, row])),
            )
            found.append(advance(found[-1], reading, self.baseline, limits))
        return found[1:]

    def first(self, n: int) -> "Watch":
        """The first readings alone."""
        return replace(self, later=self.later.rows(0, n), is_settled=self.is_settled[:n])


@pytest.fixture(scope="session")
def watch(film_life: Callable[..., StiffnessHistory]) -> Callable[..., Watch]:
    """Learn from the first days of the life of a seed; the rest is for deciding."""
    learned: dict[bytes, QuantityBaseline] = {}

    def begin(seed: int, days: int = 140, **changes: Callable[..., object]) -> Watch:
        history = film_life(seed, days=days, **changes)
        until_ns = history.time_ns[0] + LEARNING_DAYS * DAY_NS
        n = int(np.searchsorted(history.time_ns, until_ns))
        limits = OperatingLimits(92.3, 330.0, warm_up_s=3600.0)
        is_settled = operation_history(
            history.time_ns, history.speed_rpm, history.power_mw, limits
        ).is_settled
        key = history.ln_k[:, :n].tobytes()
        if key not in learned:
            origin = Origin("U1", "UJB", "dynamic", 1, "Ada", int(until_ns))
            of_all = learn(
                *(history.rows(0, n), is_settled[:n], origin, BaselineSettings()),
                (Watched.STIFFNESS,),
            )
            found = of_all.of(Watched.STIFFNESS, "x")
            assert found is not None
            learned[key] = found
        return Watch(learned[key], history.rows(n, len(history)), is_settled[n:])

    return begin
