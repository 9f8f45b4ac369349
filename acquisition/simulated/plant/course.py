"""`Course`: what a simulated unit goes through as time goes by."""

from dataclasses import dataclass
from typing import Protocol

from acquisition.simulated.plant.scenario import Scenario


class Course(Protocol):
    """Scenarios one after the other.

    Films, brackets, forces, speed and everything of `Conditions` may change between two of them;
    the rest stays as it is at the start. The unit follows in straight lines, its films in steps.
    """

    @property
    def rated_speed_rpm(self) -> float:
        """Speed that the unit has most of the time, above zero."""
        ...

    def at(self, elapsed_s: float) -> Scenario:
        """What holds some time after the first sample; called with rising times."""
        ...


@dataclass(frozen=True)
class SteadyCourse:
    """One scenario for ever."""

    scenario: Scenario

    @property
    def rated_speed_rpm(self) -> float:
        """Speed of the scenario."""
        return self.scenario.speed_rpm

    def at(self, elapsed_s: float) -> Scenario:  # noqa: ARG002  always the same
        """The scenario."""
        return self.scenario
