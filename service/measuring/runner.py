"""The program's loop in one process: acquire, hand over within memory, analyse, record."""

import asyncio
from collections.abc import Mapping

from acquisition.clock import Clock
from core.samples.blocks import SampleBlock
from service.live.live_view import LiveView
from service.measuring.acquiring import Acquirer
from service.measuring.alarms.engine import AlarmEngine
from service.measuring.analysing import Analyser
from service.measuring.bus import Bus
from service.measuring.films.keeper import FilmKeeper
from service.measuring.recorder import Recorder
from service.measuring.watched_unit import WatchedUnit
from service.runtime.heartbeats import Heartbeats, Pulse

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
        films: FilmKeeper,
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
