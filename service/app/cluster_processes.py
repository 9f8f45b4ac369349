"""`padwatch acquire` and `padwatch analyse`: acquisition and analysis in separate processes."""

import asyncio
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from functools import partial

from core.alarms.alarm import PLANT
from service.app.analysis import Analysis, opened_analysis
from service.app.health_page import HealthServer
from service.app.process import Host, Supervision
from service.app.storage import database_path
from service.cluster.consumer import Consumer, add_consumer
from service.cluster.ownership import Holds, Leadership, Partition
from service.cluster.progress import UnitProgress, memories_of, usable
from service.cluster.publisher import Publisher, add_publisher
from service.cluster.session import identity_of
from service.cluster.silent_units import SilenceWatch, SilentUnits, silences_s
from service.live.alarm_list import SHARED
from service.measuring.acquirer import Acquirer
from service.measuring.live_view import LiveView
from service.measuring.sources import WatchedUnit
from service.runtime.heartbeats import Heartbeats, Loop
from service.runtime.metrics import MEASURED, Families
from service.runtime.periodic import periodic
from service.settings.core_values import stale_after_s
from service.settings.plant import PlantFile
from service.settings.processes import StreamSettings
from service.settings.storage import Origin
from service.store.holds import exclusive_use

DRAIN_S = 3.0
"""Longest time to publish the waiting blocks when the process stops, s."""


async def run_acquire(
    plant: PlantFile, settings: StreamSettings, units: Mapping[str, WatchedUnit], host: Host
) -> None:
    """Acquire and publish the samples of units until SIGINT or SIGTERM."""
    clock, beats = host.clock, Heartbeats(host.clock)
    live = LiveView([unit.id for unit in plant.unit], clock, stale_after_s(plant))
    identities = {unit.id: identity_of(plant, unit) for unit in plant.unit if unit.id in units}
    publisher = Publisher(plant, settings, identities, clock)
    acquirer = Acquirer(units, live, clock, publisher.publish, publisher.publish_link, beats)

    async def drain(acquiring: asyncio.Task[None]) -> None:
        acquiring.cancel()
        with suppress(TimeoutError):  # the rings of the devices may still contain the samples
            await asyncio.wait_for(publisher.waiting.drained(), DRAIN_S)

    parts = (lambda: {"stream": publisher.trouble}, partial(add_publisher, publisher=publisher))
    supervision = Supervision(host, beats, live.status, units)
    health = HealthServer(supervision, *parts)
    loops = {"publish": publisher.run, "health": health.run}
    await supervision.run_until_stopped(loops, acquirer.run, drain)


WATCH_EVERY_S = 1.0


async def run_analyse(
    plant: PlantFile, partition: Partition, settings: StreamSettings, host: Host
) -> None:
    """Analyse the units of a partition until SIGINT or SIGTERM.

    Parameters
    ----------
    plant, partition
        Plant with the units of all partitions, and the partition of this process.
    settings
        Settings of the stream of sample blocks.
    host
        Surroundings of the process, with the listening socket of the health page.

    Raises
    ------
    StoreError
        If the database cannot be used, or the locks of the units were lost.
    StreamAnewError
        If the stream was replaced, or lost confirmed messages, while it was read.
    """
    with ExitStack() as stack:
        if plant.store.postgresql is None:
            stack.enter_context(exclusive_use(database_path(plant)))
        own, share = partition.part_of(plant), partition.share_of(plant)
        opened = opened_analysis(own, Origin.LIVE, host.clock, share)
        analysis = stack.enter_context(opened)
        analysing = Analysing(plant, settings, analysis)
        parts = (analysing.checks, analysing.add_metrics, analysing.shown)
        supervision = Supervision(host, analysis.beats, analysis.live.status, analysis.monitors)
        health = HealthServer(supervision, *parts)
        try:
            await supervision.run_until_stopped({"health": health.run}, analysing.run)
        finally:
            await analysing.close()


@dataclass
class Analysing:
    """Analysis of the units of a partition of `plant`, from standby to stop."""

    plant: PlantFile
    settings: StreamSettings
    analysis: Analysis
    _is_started: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        analysis = self.analysis
        self._holds = Holds(analysis.store, analysis.monitors, analysis.clock)

    async def close(self) -> None:
        """Write all pending data, then release the units to other processes."""
        if self._is_started:
            await self.analysis.close()
        self._holds.release()

    async def run(self) -> None:
        """Wait for the locks of the units of this process, then analyse until cancelled."""
        analysis, monitors = self.analysis, self.analysis.monitors
        store, clock, live = analysis.store, analysis.clock, analysis.live
        await self._holds.take()
        stored = {unit: await asyncio.to_thread(store.position, unit) for unit in monitors}
        memories = memories_of(found for found in stored.values() if found is not None)
        await analysis.start(memories)
        self._is_started = True

        async def begin(stream: str, newest: int) -> dict[str, UnitProgress]:
            """Return the progress of each unit, at which its analysis resumes."""
            parts = (analysis.analyser, live, analysis.recorder, clock)
            progress = {}
            for unit in analysis.plant.unit:
                reach = await asyncio.to_thread(store.reach, unit.id)
                position = usable(stored[unit.id], stream, newest)
                identity, memory = identity_of(self.plant, unit), memories.get(unit.id)
                done = reach if position is None else None
                progress[unit.id] = UnitProgress(identity, stream, position, memory, *parts, done)
            return progress

        consumer = Consumer(self.plant, self.settings, begin, analysis.recorder, clock)
        analysis.stream = consumer
        everywhere = [unit.id for unit in self.plant.unit]
        silent = SilentUnits(everywhere, analysis.alarms, store, clock)
        after_s = silences_s(analysis.plant.unit, self.settings.silent_after_s)
        silence = SilenceWatch(after_s, analysis.analyser, live, clock)

        async def watch() -> None:
            """Check that this process holds its units, and which units are silent."""
            await asyncio.to_thread(self._holds.require)
            silence.look(consumer.units, consumer.trouble, consumer.waiting)

        def held() -> list[str]:
            """Return the units and shared parts whose state this process publishes now."""
            service = [PLANT] if analysis.part.leads else []
            return [*monitors, *service, *([SHARED] if silent.is_watching else [])]

        shared = {**analysis.shared_loops, "silent units": silent.run}
        leadership = Leadership(store.hold, shared, analysis.beats, clock)
        loops: dict[str, Loop] = {
            "lead": leadership.run,
            "record": analysis.recorder.run,
            "stream": consumer.run,
            "watch": partial(periodic, watch, WATCH_EVERY_S, clock),
            **analysis.reporting_loops(held),
            **analysis.own_loops,
        }
        async with asyncio.TaskGroup() as tasks:
            analysis.beats.start(loops, tasks)

    def checks(self) -> dict[str, str | None]:
        """Return the fault of each required part, for the health page; None if it works."""
        waits_for, stream = self._holds.waits_for, self.analysis.stream
        return {
            "units": None if waits_for is None else f"standing by: {waits_for}",
            "store": self.analysis.live.store_error,
            "stream": stream.trouble if stream else "not begun",
        }

    def shown(self) -> dict[str, str]:
        """Return conditions of this host; only the leading process raises alarms about them."""
        parts, shown = self.analysis, {"database": self.analysis.store.kind}
        if self._is_started:
            shown |= {
                "disk": str(parts.space),
                "stored data": parts.soundness.trouble or "ok",
                "captures": parts.captures.trouble or "ok",
                "recordings": parts.recording_error or "ok",
            }
        return shown

    def add_metrics(self, families: Families) -> None:
        """Add the metrics of this process to `families`."""
        families.add_program(self.analysis.store.kind)
        if self.analysis.stream is not None:
            add_consumer(families, self.analysis.stream)
        families.include(MEASURED)
