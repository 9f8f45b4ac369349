"""`Timings`: the durations that the service takes note of while it works."""

from collections.abc import Iterable

from acquisition.clock import Clock
from service.runtime.metrics import Durations

ASSESSMENT_BOUNDS_S = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0)
"""An assessment takes some milliseconds."""

COMMIT_BOUNDS_S = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0)
"""A commit waits for the disk, and for up to five seconds for who holds the database."""


class Timings:
    """Durations by what took them.

    Parameters
    ----------
    units
        Units of the plant: all that may be told apart.

    Attributes
    ----------
    assessments
        What results took, by unit.
    commits
        What the store took to write findings.
    """

    def __init__(self, units: Iterable[str], clock: Clock) -> None:
        self._clock = clock
        self.assessments = {unit: Durations(ASSESSMENT_BOUNDS_S, clock) for unit in units}
        self.commits = Durations(COMMIT_BOUNDS_S, clock)

    def begin(self) -> float:
        """When something begins, for `assessed`."""
        return self._clock.monotonic_s()

    def assessed(self, unit: str, began_s: float) -> None:
        """Note what a result took."""
        self.assessments[unit].observe(self._clock.monotonic_s() - began_s)
