"""Measured durations of assessments (results of a bearing) and of database commits."""

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
"""Histogram bounds of the duration of an assessment, s; typical are some milliseconds."""

COMMIT_BOUNDS_S = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0)
"""Histogram bounds of the duration of a commit, s; a commit waits for the disk and up to five
seconds for the database lock."""


class Timings:
    """Histograms of the durations of assessments, by unit, and of database commits."""

    def __init__(self, units: Iterable[str], clock: Clock) -> None:
        self._clock = clock
        self.assessments = {unit: Durations(ASSESSMENT_BOUNDS_S, clock) for unit in units}
        self.commits = Durations(COMMIT_BOUNDS_S, clock)

    def begin(self) -> float:
        """Return the present monotonic time, s; the start of an assessment for `assessed`."""
        return self._clock.monotonic_s()

    def assessed(self, unit: str, began_s: float) -> None:
        """Add the duration of an assessment that began at ``began_s`` and ends now."""
        self.assessments[unit].observe(self._clock.monotonic_s() - began_s)


class TimedMonitor(UnitMonitor):
    """Unit monitor that measures the durations of its assessments.

    Parameters
    ----------
    monitor
        Monitor whose state is moved to this object; it must not be used afterwards.
    """

    def __init__(self, monitor: UnitMonitor, timings: Timings) -> None:
        vars(self).update(vars(monitor))
        self._timings = timings

    def steps(self, block: SampleBlock) -> Iterator[Assessment]:
        """Analyse a block, one bearing at a time; raises as `UnitMonitor.steps` does."""
        steps = super().steps(block)
        began_s = self._timings.begin()
        for assessment in steps:
            self._timings.assessed(block.unit, began_s)
            yield assessment
            began_s = self._timings.begin()


def timed(units: Mapping[str, WatchedUnit], timings: Timings) -> dict[str, WatchedUnit]:
    """Return the units with each monitor replaced by a `TimedMonitor`."""
    return {
        unit: replace(watched, monitor=TimedMonitor(watched.monitor, timings))
        for unit, watched in units.items()
    }


def timed_sources(units: Mapping[str, WatchedUnit]) -> dict[str, TimedSource]:
    """Return the sources that measure the durations of their polls, by unit."""
    sources = {unit: watched.source for unit, watched in units.items()}
    return {unit: each for unit, each in sources.items() if isinstance(each, TimedSource)}
