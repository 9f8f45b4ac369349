"""A baseline to decide by, and decisions led on reading by reading."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import pytest

from core.baseline.baseline import Origin, QuantityBaseline
from core.baseline.history import StiffnessHistory
from core.baseline.learning import learn
from core.baseline.settings import BaselineSettings
from core.change.backtest import DecisionHistory, decide_all, operation_history
from core.change.decision import INITIAL_DECISION, Decision, outcomes, step
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
        return decide_all(self.later, self.is_settled, "k_x", self.baseline, limits)

    def steps(
        self, limits: ChangeLimits = LIMITS, begin: Decision = INITIAL_DECISION
    ) -> list[Decision]:
        """Decide reading by reading."""
        found, history = [begin], self.later
        for row in range(len(history)):
            settled = self.is_settled[row : row + 1]
            one = history.rows(row, row + 1)
            columns = (one.conditions, one.ln_k[0], one.u_random[0], one.outcome[0])
            [outcome] = outcomes(*columns, settled, self.baseline)
            found.append(step(found[-1], int(one.time_ns[0]), outcome, self.baseline, limits))
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
            of_all = learn(history.rows(0, n), is_settled[:n], origin, BaselineSettings())
            found = of_all.of("k_x")
            assert found is not None
            learned[key] = found
        return Watch(learned[key], history.rows(n, len(history)), is_settled[n:])

    return begin
