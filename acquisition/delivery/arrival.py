"""`Arrival`: when samples had come, by both clocks of the host."""

from dataclasses import dataclass

from acquisition.clock import Clock
from core.units import NS_PER_S


@dataclass(frozen=True)
class Arrival:
    """A moment at the host.

    Parameters
    ----------
    host_ns
        UTC nanoseconds; of a clock that may be set.
    steady_s
        Of the clock that never steps.
    """

    host_ns: int
    steady_s: float

    @classmethod
    def now(cls, clock: Clock) -> "Arrival":
        """Now."""
        return cls(clock.now_ns(), clock.monotonic_s())

    def step_s_since(self, before: "Arrival") -> float:
        """By how much the host's clock has been set forward between two moments."""
        return (self.host_ns - before.host_ns) / NS_PER_S - (self.steady_s - before.steady_s)
