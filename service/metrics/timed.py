"""Units whose analysis is timed, without the runner or the numerics knowing of it."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

from core.machine.unit import Unit
from core.monitor.assessment import Assessment
from core.monitor.monitor_port import Monitor
from core.monitor.monitor_state import MonitorState
from core.samples.blocks import SampleBlock
from core.samples.gaps import Gap, Reach, SampleAccount
from service.metrics.polls import TimedSource
from service.metrics.timings import Timings
from service.roles.watched_unit import WatchedUnit


class TimedMonitor:
    """A monitor that notes what its results take."""

    def __init__(self, monitor: Monitor, timings: Timings) -> None:
        self._monitor, self._timings = monitor, timings
        self.unit: Unit = monitor.unit

    @property
    def account(self) -> SampleAccount:
        """Where every sample went that the unit's device offered."""
        return self._monitor.account

    def adopt(self, unit: Unit) -> None:
        """Take a new description of the same unit; raises as the monitor does."""
        self._monitor.adopt(unit)
        self.unit = unit

    def go_on(self, reach: Reach | None) -> None:
        """Go on after a stop, before the first block."""
        self._monitor.go_on(reach)

    @property
    def state(self) -> MonitorState:
        """What must be known beside its newest samples."""
        return self._monitor.state

    def rewind(self, state: MonitorState) -> None:
        """Expect samples once more."""
        self._monitor.rewind(state)

    def settle(self, state: MonitorState) -> None:
        """Be as another one was."""
        self._monitor.settle(state)

    def drain_gaps(self) -> list[Gap]:
        """Hand over the gaps found since the last call, to be recorded."""
        return self._monitor.drain_gaps()

    def require(self, block: SampleBlock) -> None:
        """Refuse a block that does not fit; raises as the monitor does."""
        self._monitor.require(block)

    def steps(self, block: SampleBlock) -> Iterator[Assessment]:
        """Take a block in, one bearing at a time; raises as the monitor does."""
        steps = self._monitor.steps(block)
        began_s = self._timings.begin()
        for assessment in steps:
            self._timings.assessed(block.unit, began_s)
            yield assessment
            began_s = self._timings.begin()

    def ingest(self, block: SampleBlock) -> list[Assessment]:
        """Take a block in and return what has been learnt by it; raises as the monitor does."""
        return list(self.steps(block))


def timed_monitors(monitors: Mapping[str, Monitor], timings: Timings) -> dict[str, Monitor]:
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
