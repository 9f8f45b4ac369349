"""Blocks to findings, and what is remembered of a unit when it moves."""

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from acquisition.clock import Clock
from core.alarms.board import AlarmMemory
from core.change.film_judge import FilmMemory
from core.monitor.monitor import MonitorState, UnitMonitor
from core.samples.blocks import SampleBlock
from core.samples.gaps import Count, Counts, SampleAccount
from service.live.live_view import LiveView
from service.measuring.acquirer import Acquirer, Bus, LinkNews
from service.measuring.alarm_engine import AlarmEngine
from service.measuring.films import FilmMonitor
from service.measuring.recorder import Findings, Recorder
from service.measuring.sources import WatchedUnit
from service.runtime.heartbeats import Heartbeats, Pulse
from service.store.port import UnitGap

VERSION = 1


@dataclass(frozen=True)
class UnitMemory:
    """A unit between two blocks.

    Parameters
    ----------
    films
        Where they are watched.
    count
        That its blocks are in.
    version
        Of this form.
    """

    monitor: MonitorState
    alarms: AlarmMemory
    films: FilmMemory | None
    count: Count | None = None
    version: int = VERSION


NO_MEMORIES: Mapping[str, UnitMemory] = MappingProxyType({})


NOTHING = Findings()

TURNS = 3
"""Of the event loop between two bearings: what a request takes from its arrival to its answer."""


class Analyser:
    """Analyses the blocks of all units, one block after the other.

    A device that counts the same epoch anew is given another one here, for all that follows.
    """

    def __init__(
        self,
        monitors: Mapping[str, UnitMonitor],
        live: LiveView,
        recorder: Recorder,
        alarms: AlarmEngine,
        films: FilmMonitor,
    ) -> None:
        self._monitors, self._live, self._recorder = monitors, live, recorder
        self._alarms, self._films = alarms, films
        self._counts = {unit: Counts() for unit in monitors}

    def require(self, block: SampleBlock) -> None:
        """Refuse a block that does not fit its unit, with a `BlockMisfitError`."""
        self._monitors[block.unit].require(block)

    async def take(self, block: SampleBlock, sampled_s: float) -> None:
        """Take a block in, and hand over what it has taught.

        Parameters
        ----------
        sampled_s
            When its samples were there, by this process's steady clock.
        """
        findings = await self.learn(block, sampled_s)
        if findings != NOTHING:
            self._recorder.put(findings)

    async def learn(self, block: SampleBlock, sampled_s: float) -> Findings:
        """Take a block in, as `take` does, and return what it has taught."""
        monitor = self._monitors[block.unit]
        block = self._counts[block.unit].placed(block)
        found = []
        for assessment in monitor.steps(block):
            found.append(assessment)
            await _others()
        assessments, films = self._films.take(block.unit, found)
        gaps = [UnitGap(block.unit, gap) for gap in monitor.drain_gaps()]
        for assessment in assessments:
            self._live.set_assessment(assessment, sampled_s)
        self._live.set_received(block, monitor.account, sampled_s)
        news = self._alarms.take(block, assessments, self._films.conditions(films))
        if assessments or gaps or news:
            return Findings(assessments, gaps, news, films)
        return NOTHING

    async def relive(
        self, block: SampleBlock, sampled_s: float, account: SampleAccount | None = None
    ) -> None:
        """Take a block in whose findings are stored already; nobody is told again.

        Parameters
        ----------
        account
            Of the unit's samples, as it was stored: the monitor counts these a second time.
        """
        monitor = self._monitors[block.unit]
        block = self._counts[block.unit].replayed(block)
        for _ in monitor.steps(block):
            await _others()
        monitor.drain_gaps()
        self._live.set_received(block, account or monitor.account, sampled_s)

    def state(self, unit: str) -> MonitorState:
        """What must be known of a monitor beside its newest samples."""
        return self._monitors[unit].state

    def memory(self, unit: str) -> UnitMemory:
        """What must be known of a unit beside its newest samples."""
        return UnitMemory(
            self.state(unit),
            self._alarms.memory(unit),
            self._films.memory(unit),
            self._counts[unit].count,
        )

    def rewind(self, unit: str, memory: UnitMemory) -> None:
        """Let the monitor of a unit expect its newest samples once more, none of them missing."""
        self._monitors[unit].go_on(None)
        self._monitors[unit].rewind(memory.monitor)
        self._counts[unit].restore(memory.count)

    def settle(self, unit: str, memory: UnitMemory) -> None:
        """Let the monitor of a unit, after these samples, be as it was."""
        self._monitors[unit].settle(memory.monitor)

    def refuse(self, unit: str, reason: str) -> None:
        """Let alarms know that a message of a unit cannot be used."""
        self._alarms.refuse(unit, reason)

    def hear(self, news: LinkNews) -> None:
        """Let alarms know whether samples of a unit arrive."""
        self._alarms.link(news.unit, news.is_connected, news.reason)

    def is_connected(self, unit: str) -> bool:
        """Whether samples of a unit arrive, by what alarms have heard last."""
        return self._alarms.is_connected(unit)


async def _others() -> None:
    """Let all others have their turns: a bearing takes milliseconds, and many may be waiting."""
    for _ in range(TURNS):
        await asyncio.sleep(0)


BUS_CAPACITY = 512


class Runner:
    """Runs all units until it is cancelled. A bug in any of its tasks ends them all."""

    def __init__(
        self,
        units: Mapping[str, WatchedUnit],
        live: LiveView,
        recorder: Recorder,
        clock: Clock,
        alarms: AlarmEngine,
        films: FilmMonitor,
        bus: Bus | None = None,
        beats: Heartbeats | None = None,
    ) -> None:
        monitors = {unit: watched.monitor for unit, watched in units.items()}
        self._recorder, self._clock = recorder, clock
        self._bus = bus or Bus(BUS_CAPACITY, clock)
        self._beats = beats or Heartbeats(clock)
        self._analyser = Analyser(monitors, live, recorder, alarms, films)
        self._acquirer = Acquirer(
            units, live, clock, self._bus.publish, self._analyser.hear, self._beats
        )

    async def run(self) -> None:
        """Acquire and analyse; ends when every source has come to its end."""
        async with asyncio.TaskGroup() as tasks:
            recording = tasks.create_task(
                self._beats.tend("record", self._recorder.run), name="record"
            )
            analysis = tasks.create_task(self._beats.tend("analyse", self._analyse), name="analyse")
            await self._acquirer.run()
            await self._bus.drained()
            analysis.cancel()
            await self._recorder.settled()
            recording.cancel()
            self._beats.release("analyse", "record")  # there is nothing left for them

    async def _analyse(self, pulse: Pulse) -> None:
        pulse.rest()
        async for block in self._bus.blocks():
            pulse.beat()
            await self._analyser.take(block, self._sampled_s(block))
            self._bus.done()
            await asyncio.sleep(0)  # more blocks may be waiting, but so may others
            pulse.rest()

    def _sampled_s(self, block: SampleBlock) -> float:
        if block.sampled_s is not None:
            return block.sampled_s
        return self._clock.monotonic_s() - self._bus.oldest_wait_s
