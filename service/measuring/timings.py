"""How long polls, evaluations and commits take."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from acquisition.clock import Clock
from core.monitor.assessment import Assessment
from core.monitor.monitor import UnitMonitor
from core.samples.blocks import SampleBlock
from service.measuring.sources import WatchedUnit
from service.runtime.metrics import Durations
from service.runtime.polls import TimedSource

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


class TimedMonitor(UnitMonitor):
    """A monitor whose results are timed.

    Parameters
    ----------
    monitor
        Taken over with all its state; it must not be used apart from this one.
    """

    def __init__(self, monitor: UnitMonitor, timings: Timings) -> None:
        vars(self).update(vars(monitor))
        self._timings = timings

    def steps(self, block: SampleBlock) -> Iterator[Assessment]:
        """Take a block in, one bearing at a time; raises as the monitor does."""
        steps = super().steps(block)
        began_s = self._timings.begin()
        for assessment in steps:
            self._timings.assessed(block.unit, began_s)
            yield assessment
            began_s = self._timings.begin()


def timed_monitors(monitors: Mapping[str, UnitMonitor], timings: Timings) -> dict[str, UnitMonitor]:
    """The same monitors, timed."""
    return {unit: TimedMonitor(monitor, timings) for unit, monitor in monitors.items()}


def timed(units: Mapping[str, WatchedUnit], timings: Timings) -> dict[str, WatchedUnit]:
    """The same units with monitors that are timed."""
    return {
        unit: replace(watched, monitor=TimedMonitor(watched.monitor, timings))
        for unit, watched in units.items()
    }


def timed_sources(units: Mapping[str, WatchedUnit]) -> dict[str, TimedSource]:
    """The sources that are timed, by unit."""
    return {
        unit: watched.source
        for unit, watched in units.items()
        if isinstance(watched.source, TimedSource)
    }
