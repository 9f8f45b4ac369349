"""Units whose analysis is timed, without the runner or the numerics knowing of it."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

from core.monitor.assessment import Assessment
from core.monitor.monitor import UnitMonitor
from core.samples.blocks import SampleBlock
from service.measuring.metrics.timings import Timings
from service.measuring.watched_unit import WatchedUnit
from service.runtime.polls import TimedSource


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
