"""`StateLimits`: which limits hold in which operating state, and in which none do."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self

from core.alarms.alarm import AlarmLevel, Condition, unknown
from core.alarms.limits import Limits, judge
from core.assessment import Assessment
from core.condition.operating_state import STEADY, OperatingState
from core.quality import Reading, Reason, missing

AT_SPEED = STEADY
"""Where limits of vibration count unless said otherwise."""

EVERY_STATE = frozenset(OperatingState)

States = frozenset[OperatingState]


@dataclass(frozen=True)
class StateLimits:
    """Limits by operating state. In a state without any, an alarm is suppressed by design.

    Where the state is not known nothing is suppressed, and the strictest limits count.

    Parameters
    ----------
    tables
        States with their limits; at least one.

    Raises
    ------
    ValueError
        If there is no table, one has no state, or a state stands in two of them.
    """

    tables: tuple[tuple[States, Limits], ...]

    def __post_init__(self) -> None:
        seen: set[OperatingState] = set()
        for states, _ in self.tables:
            if not states:
                raise ValueError("limits that count in no operating state")
            for state in sorted(states & seen):
                raise ValueError(f"two limits for the operating state {state.name.lower()}")
            seen |= states
        if not seen:
            raise ValueError("no limits for any operating state")

    @classmethod
    def single(cls, limits: Limits, states: Iterable[OperatingState] = EVERY_STATE) -> Self:
        """The same limits in some states."""
        return cls(((frozenset(states), limits),))

    @property
    def strictest(self) -> Limits:
        """The limits with the lowest upper limit."""
        return min((limits for _, limits in self.tables), key=lambda limits: limits.lowest)

    def at(self, state: OperatingState | None) -> Limits | None:
        """The limits that hold in a state; None if it is one in which nothing counts."""
        if state is None or state is OperatingState.UNKNOWN:
            return self.strictest
        return next((limits for states, limits in self.tables if state in states), None)

    def judge(
        self, reading: Reading, state: OperatingState | None, held: AlarmLevel | None
    ) -> Condition:
        """Compare a reading with what holds now."""
        limits = self.at(state)
        return outside(state) if limits is None else judge(reading, limits, held)


def outside(state: OperatingState | None) -> Condition:
    """The condition in a state in which an alarm does not count: not known, and not told.

    Nothing is judged meanwhile, so that nothing returns to normal by being suppressed.
    """
    word = (state or OperatingState.UNKNOWN).name.lower()
    return unknown(word, word)


def state_of(assessment: Assessment) -> OperatingState | None:
    """The operating state of a result; where nobody has told it, a standstill at least is known."""
    condition = assessment.condition
    if condition is not None and condition.state is not OperatingState.UNKNOWN:
        return condition.state
    speed = assessment.readings.get("speed_rpm", missing(Reason.NOT_MEASURED))
    return OperatingState.STANDSTILL if speed.quality.reason is Reason.STANDSTILL else None
