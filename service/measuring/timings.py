"""Measurement of the durations of assessments and of commits to the store."""

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
"""Bucket bounds of assessment durations, s; an assessment takes a few milliseconds."""

COMMIT_BOUNDS_S = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0)
"""Bucket bounds of commit durations, s: disk writes, and up to 5 s for the database lock."""


class Timings:
    """Duration histograms of the assessments of each unit and of the commits."""

    def __init__(self, units: Iterable[str], clock: Clock) -> None:
        self._clock = clock
        self.assessments = {unit: Durations(ASSESSMENT_BOUNDS_S, clock) for unit in units}
        self.commits = Durations(COMMIT_BOUNDS_S, clock)

    def begin(self) -> float:
        """Return the monotonic start time of an assessment, for the later call of `assessed`."""
        return self._clock.monotonic_s()

    def assessed(self, unit: str, began_s: float) -> None:
        """Record the duration of an assessment that started at ``began_s`` and ends now."""
        self.assessments[unit].observe(self._clock.monotonic_s() - began_s)


class TimedMonitor(UnitMonitor):
    """Unit monitor that measures the durations of its assessments.

    Parameters
    ----------
    monitor
        Monitor whose state this object takes over; it must not be used afterwards.
    """

    def __init__(self, monitor: UnitMonitor, timings: Timings) -> None:
        vars(self).update(vars(monitor))
        self._timings = timings

    def steps(self, block: SampleBlock) -> Iterator[Assessment]:
        """Analyse a block, one bearing at a time; same errors as `UnitMonitor.steps`."""
        steps = super().steps(block)
        began_s = self._timings.begin()
        for assessment in steps:
            self._timings.assessed(block.unit, began_s)
            yield assessment
            began_s = self._timings.begin()


def timed(units: Mapping[str, WatchedUnit], timings: Timings) -> dict[str, WatchedUnit]:
    """Return the units with monitors that measure their assessment durations."""
    return {
        unit: replace(watched, monitor=TimedMonitor(watched.monitor, timings))
        for unit, watched in units.items()
    }


def timed_sources(units: Mapping[str, WatchedUnit]) -> dict[str, TimedSource]:
    """Return the sources that measure their poll durations, by unit."""
    sources = {unit: watched.source for unit, watched in units.items()}
    return {unit: each for unit, each in sources.items() if isinstance(each, TimedSource)}
