"""Analysis of sample blocks, and transfer of a unit's analysis state to another process."""

import asyncio
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from time import perf_counter

from prometheus_client import Histogram

from acquisition.clock import Clock
from core.alarms.board import AlarmMemory
from core.change.film_judge import FilmMemory
from core.monitor.assessment import Assessment
from core.monitor.monitor import MonitorState, UnitMonitor
from core.samples.blocks import SampleBlock
from core.samples.gaps import Count, Counts, SampleAccount
from service.measuring.acquirer import Acquirer, Bus, LinkNews
from service.measuring.alarm_engine import AlarmEngine
from service.measuring.films import FilmMonitor
from service.measuring.live_view import LiveView
from service.measuring.recorder import Finding, Recorder
from service.measuring.sources import WatchedUnit
from service.runtime.heartbeats import Heartbeats, Pulse
from service.runtime.metrics import MEASURED
from service.store.port import UnitGap

VERSION = 1


@dataclass(frozen=True)
class UnitMemory:
    """State of a unit's analysis between two blocks, for transfer to another process.

    Parameters
    ----------
    films
        State of the unit's films; None if they are not monitored.
    count
        Current sample count of the unit's device, with its epoch; None before the first block.
    version
        Version of this format.
    """

    monitor: MonitorState
    alarms: AlarmMemory
    films: FilmMemory | None
    count: Count | None = None
    version: int = VERSION


TURNS = 3
"""Iterations of the event loop between the analysis of two bearings, for waiting requests."""


ASSESSMENTS = Histogram(
    "padwatch_assessment_duration_seconds",
    "This is the duration of the analysis for a result of a bearing.",
    ["unit"],
    buckets=(0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0),
    registry=MEASURED,
)


def timed(
    results: Iterator[Assessment], unit: str, now_s: Callable[[], float] = perf_counter
) -> Iterator[Assessment]:
    """Yield the results of a unit; record the computing time of each in `ASSESSMENTS`.

    `now_s` returns the time of a monotonic clock, s.
    """
    began_s = now_s()
    for result in results:
        ASSESSMENTS.labels(unit).observe(now_s() - began_s)
        yield result
        began_s = now_s()


@dataclass(eq=False)
class Analyser:
    """Analyser of the blocks of all units, one block at a time.

    If a device restarts its sample count within an epoch, the analyser assigns a new epoch.
    """

    monitors: Mapping[str, UnitMonitor]
    live: LiveView
    alarms: AlarmEngine
    films: FilmMonitor

    def __post_init__(self) -> None:
        self._counts = {unit: Counts() for unit in self.monitors}
        for unit in self.monitors:
            ASSESSMENTS.labels(unit)  # a unit without results has a count of zero

    async def analyse(self, block: SampleBlock, sampled_s: float) -> list[Finding]:
        """Analyse a block, last sampled at the monotonic time ``sampled_s``; return findings."""
        monitor = self.monitors[block.unit]
        block = self._counts[block.unit].placed(block)
        found = []
        for assessment in timed(monitor.steps(block), block.unit):
            found.append(assessment)
            await _yield()
        assessments, films = self.films.take(block.unit, found)
        gaps = [UnitGap(block.unit, gap) for gap in monitor.drain_gaps()]
        for assessment in assessments:
            self.live.set_assessment(assessment, sampled_s)
        self.live.set_received(block, monitor.account, sampled_s)
        news = self.alarms.take(block, assessments, self.films.conditions(films))
        return [*assessments, *gaps, *news, *films]

    async def replay(
        self, block: SampleBlock, sampled_s: float, account: SampleAccount | None = None
    ) -> None:
        """Restore the monitor from a block with stored findings, last sampled at ``sampled_s``.

        `account` are the stored sample counts, shown instead of the counts of the monitor, which
        would count replayed samples twice.
        """
        monitor = self.monitors[block.unit]
        block = self._counts[block.unit].replayed(block)
        for _ in monitor.steps(block):
            await _yield()
        monitor.drain_gaps()
        self.live.set_received(block, account or monitor.account, sampled_s)

    def memory(self, unit: str) -> UnitMemory:
        """Return the analysis state of a unit, from which another process continues."""
        monitor, alarms = self.monitors[unit].state, self.alarms.units[unit].memory
        return UnitMemory(monitor, alarms, self.films.memory(unit), self._counts[unit].count)

    def rewind(self, unit: str, memory: UnitMemory) -> None:
        """Prepare the monitor of a unit for a replay of its newest samples, from a stored state."""
        self.monitors[unit].go_on(None)
        self.monitors[unit].rewind(memory.monitor)
        self._counts[unit].count = memory.count

    def note_link(self, news: LinkNews) -> None:
        """Update the link alarm of a unit."""
        self.alarms.link(news.unit, news.is_connected, news.reason)


async def _yield() -> None:
    """Let other tasks run between two bearings; one bearing takes milliseconds."""
    for _ in range(TURNS):
        await asyncio.sleep(0)


BUS_CAPACITY = 512


@dataclass(frozen=True)
class Runner:
    """Acquisition, analysis and storage in one process; an exception in one task ends all tasks."""

    units: Mapping[str, WatchedUnit]
    live: LiveView
    analyser: Analyser
    recorder: Recorder
    bus: Bus
    beats: Heartbeats
    clock: Clock

    async def run(self) -> None:
        """Run until all sources have ended and their results are stored, or the store fails."""
        links = (self.bus.put, self.analyser.note_link, self.beats)
        acquirer = Acquirer(self.units, self.live, self.clock, *links)
        async with asyncio.TaskGroup() as tasks:
            loops = {"record": self.recorder.run, "analyse": self._analyse}
            recording, analysis = self.beats.start(loops, tasks)
            await acquirer.run()
            await self.bus.join()
            analysis.cancel()
            await self.recorder.settled()
            recording.cancel()
            self.beats.release("analyse", "record")  # they have finished

    async def _analyse(self, pulse: Pulse) -> None:
        pulse.rest()
        while True:
            block = await self.bus.get()
            pulse.beat()
            sampled_s = block.sampled_s
            if sampled_s is None:
                sampled_s = self.clock.monotonic_s() - self.bus.oldest_wait_s
            self.recorder.put(await self.analyser.analyse(block, sampled_s))
            self.bus.task_done()
            await asyncio.sleep(0)  # let other tasks run while blocks wait
            pulse.rest()
