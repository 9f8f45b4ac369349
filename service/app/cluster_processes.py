"""`padwatch acquire` and `padwatch analyse`: acquisition and analysis in separate processes."""

import asyncio
import socket
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from functools import partial

from prometheus_client.process_collector import ProcessCollector

from acquisition.clock import Clock
from core.alarms.alarm import PLANT
from core.monitor.monitor import UnitMonitor
from service.app.health_page import Health, HealthServer
from service.app.measuring_process import Analysis, ProcessContext, analysis_on, reporting_loops
from service.app.notifications import router_of
from service.app.process import Supervision
from service.app.service_health import recording_error
from service.app.storage import database_path, open_store
from service.cluster.consumer import Consumer, add_consumer
from service.cluster.ownership import Holds, Leadership, Partition
from service.cluster.progress import UnitProgress, memories_of, usable
from service.cluster.publisher import Publisher, add_publisher
from service.cluster.session import identity_of
from service.cluster.silent_units import SilenceWatch, SilentUnits, silences_s
from service.live.alarm_list import SHARED
from service.measuring.acquirer import Acquirer, Bus
from service.measuring.analyser import BUS_CAPACITY
from service.measuring.live_view import LiveView
from service.measuring.service_alarms import StreamStatus
from service.measuring.sources import WatchedUnit
from service.notifications.message import LiveContext
from service.runtime.heartbeats import Heartbeats, Loop
from service.runtime.listening import url_of
from service.runtime.metrics import MEASURED, Families
from service.runtime.periodic import periodic
from service.runtime.service_manager import NO_MANAGER, ServiceManager
from service.settings.core_values import stale_after_s
from service.settings.plant import PlantFile
from service.settings.processes import StreamSettings
from service.settings.storage import Origin
from service.store.holds import exclusive_use

DRAIN_S = 3.0
"""Longest time to publish the waiting blocks when the process stops, s."""


async def run_acquire(
    plant: PlantFile,
    settings: StreamSettings,
    units: Mapping[str, WatchedUnit],
    listener: socket.socket,
    clock: Clock,
    announce: Callable[[str], None],
    manager: ServiceManager = NO_MANAGER,
) -> None:
    """Acquire and publish the samples of units until SIGINT or SIGTERM.

    The monitors of the units are not used. `listener` is the listening socket of the health page;
    `announce` is called with its URL.
    """
    beats, live = (
        Heartbeats(clock),
        LiveView([unit.id for unit in plant.unit], clock, stale_after_s(plant)),
    )
    identities = {unit.id: identity_of(plant, unit) for unit in plant.unit if unit.id in units}
    publisher = Publisher(plant, settings, identities, clock)
    acquirer = Acquirer(units, live, clock, publisher.publish, publisher.publish_link, beats)
    supervision = Supervision(manager, beats, live, units, clock)

    async def drain(acquiring: asyncio.Task[None]) -> None:
        acquiring.cancel()
        with suppress(TimeoutError):  # the rings of the devices may still contain the samples
            await asyncio.wait_for(publisher.waiting.drained(), DRAIN_S)

    health = HealthServer(_health(publisher, live, beats, list(units)), listener)
    supervision.ready()
    announce(url_of(listener))
    loops = {"publish": publisher.run, "health": health.run}
    await supervision.run_until_stopped(loops, acquirer.run, drain)


def _health(publisher: Publisher, live: LiveView, beats: Heartbeats, units: list[str]) -> Health:
    def checks() -> dict[str, str | None]:
        loops = {f"loop {name}": trouble for name, trouble in beats.look().items()}
        return {"stream": publisher.trouble, **loops}

    def shown() -> dict[str, str]:
        return {f"unit {unit}": live.status(unit).state.value for unit in units}

    def metrics() -> bytes:
        families = Families()
        add_publisher(families, publisher)
        families.include(ProcessCollector(registry=None))
        return families.text

    return Health(checks, shown, metrics)


WATCH_EVERY_S = 1.0


async def run_analyse(
    plant: PlantFile,
    partition: Partition,
    settings: StreamSettings,
    monitors: Mapping[str, UnitMonitor],
    listener: socket.socket,
    clock: Clock,
    announce: Callable[[str], None],
    manager: ServiceManager = NO_MANAGER,
) -> None:
    """Analyse the units of a partition until SIGINT or SIGTERM.

    Parameters
    ----------
    plant, partition
        Plant with the units of all partitions, and the partition of this process.
    settings
        Settings of the stream of sample blocks.
    monitors
        Monitors of the units of the partition, by unit id.
    listener, announce
        Listening socket of the health page, and the function that is called with its URL.
    clock, manager
        Host clock, and the service manager that is notified of start and stop.

    Raises
    ------
    StoreError
        If the database cannot be used, or the locks of the units were lost.
    StreamAnewError
        If the stream was replaced, or lost confirmed messages, while it was read.
    """
    part = partition.part_of(plant)
    live = LiveView([unit.id for unit in part.unit], clock, stale_after_s(part))
    alarm_context = LiveContext(live.assessment)
    with ExitStack() as stack:
        if plant.store.postgresql is None:
            stack.enter_context(exclusive_use(database_path(plant)))
        store = open_store(part, Origin.LIVE, router_of(part, Origin.LIVE, alarm_context, clock))
        stack.callback(store.close)
        process = ProcessContext(part, Origin.LIVE, clock, store, live, Heartbeats(clock))
        analysing = Analysing(plant, partition, settings, monitors, process, alarm_context)
        health = HealthServer(analysing.health(), listener)
        supervision = Supervision(manager, process.beats, live, monitors, clock)
        supervision.ready()
        announce(url_of(listener))
        try:
            await supervision.run_until_stopped({"health": health.run}, analysing.run)
        finally:
            await analysing.close()


class Analysing:
    """Analysis of the units of a partition, from standby to stop."""

    def __init__(
        self,
        plant: PlantFile,
        partition: Partition,
        settings: StreamSettings,
        monitors: Mapping[str, UnitMonitor],
        process: ProcessContext,
        alarm_context: LiveContext,
    ) -> None:
        self._share, self._settings = partition.share_of(plant), settings
        self._monitors, self._process, self._around = monitors, process, alarm_context
        self._plant = plant
        self._holds = Holds(process.store, monitors, process.clock)
        self._analysis: Analysis | None = None
        self._consumer: Consumer | None = None

    async def close(self) -> None:
        """Write all pending data, then release the units to other processes."""
        if self._analysis is not None:
            await self._analysis.close()
        self._holds.release()

    async def run(self) -> None:
        """Wait for the locks of the units of this process, then analyse until cancelled."""
        process = self._process
        store, clock = process.store, process.clock
        await self._holds.take()
        bus = Bus(BUS_CAPACITY, clock)  # always empty: blocks wait in the stream
        monitors = self._monitors
        stored = {
            unit: found
            for unit in monitors
            if (found := await asyncio.to_thread(store.position, unit)) is not None
        }
        memories = memories_of(stored.values())
        stream = StreamStatus(self._trouble, self._behind_s)
        analysis = self._analysis = await analysis_on(
            process, monitors, bus, self._around, self._share, memories, stream
        )

        async def begin(stream: str, newest: int) -> dict[str, UnitProgress]:
            """Return the progress of each unit, at which its analysis resumes."""
            parts = (analysis.analyser, process.live, analysis.recorder, clock)
            progress = {}
            for unit in process.plant.unit:
                reach = await asyncio.to_thread(store.reach, unit.id)
                position = usable(stored.get(unit.id), stream, newest)
                identity, memory = identity_of(self._plant, unit), memories.get(unit.id)
                done = reach if position is None else None
                progress[unit.id] = UnitProgress(identity, stream, position, memory, *parts, done)
            return progress

        consumer = Consumer(self._plant, self._settings, begin, analysis.recorder, clock)
        self._consumer = consumer
        everywhere = [unit.id for unit in self._plant.unit]
        silent = SilentUnits(everywhere, analysis.alarms, store, clock)
        after_s = silences_s(process.plant.unit, self._settings.silent_after_s)
        silence = SilenceWatch(after_s, analysis.analyser, process.live, clock)

        async def watch() -> None:
            """Check that this process holds its units, and which units are silent."""
            await asyncio.to_thread(self._holds.require)
            silence.look(consumer.units, consumer.trouble, consumer.waiting)

        def held() -> list[str]:
            """Return the units and shared parts whose state this process publishes now."""
            service = [PLANT] if self._share.leads else []
            return [*self._monitors, *service, *([SHARED] if silent.is_watching else [])]

        shared = {**analysis.shared_loops, "silent units": silent.run}
        leadership = Leadership(store.hold, shared, process.beats, clock)
        loops: dict[str, Loop] = {
            "lead": leadership.run,
            "record": analysis.recorder.run,
            "stream": consumer.run,
            "watch": partial(periodic, watch, WATCH_EVERY_S, clock),
            **reporting_loops(analysis, held),
            **analysis.own_loops,
        }
        async with asyncio.TaskGroup() as tasks:
            process.beats.start(loops, tasks)

    def _trouble(self) -> str | None:
        """Return the reason why the stream delivers no blocks; None while it delivers blocks."""
        return None if self._consumer is None else self._consumer.trouble

    def _behind_s(self) -> float:
        """Return the largest delay of the analysed blocks behind their devices, s."""
        units = self._consumer.units if self._consumer else {}
        return max((progress.behind_s for progress in units.values()), default=0.0)

    def health(self) -> Health:
        """Return the present contents of the health page of this process."""

        def checks() -> dict[str, str | None]:
            consumer = self._consumer
            waits_for = self._holds.waits_for
            loops = {f"loop {name}": t for name, t in self._process.beats.look().items()}
            return {
                "units": None if waits_for is None else f"standing by: {waits_for}",
                "store": self._process.live.store_error,
                "stream": "not begun" if consumer is None else self._trouble(),
                **loops,
            }

        def shown() -> dict[str, str]:
            live = self._process.live
            shown = {f"unit {unit}": live.status(unit).state.value for unit in self._monitors}
            shown["database"] = self._process.store.kind
            if (parts := self._analysis) is not None:
                # conditions of this host; only the leading process raises alarms about them
                shown |= {
                    "disk": str(parts.space),
                    "stored data": parts.soundness.trouble or "ok",
                    "captures": parts.captures.trouble or "ok",
                    "recordings": recording_error(parts.tape, parts.recordings) or "ok",
                }
            return shown

        def metrics() -> bytes:
            families = Families()
            families.add_program(self._process.store.kind)
            if self._consumer is not None:
                add_consumer(families, self._consumer)
            families.include(MEASURED)
            families.include(ProcessCollector(registry=None))
            return families.text

        return Health(checks, shown, metrics)
