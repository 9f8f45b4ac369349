"""The whole service in one process, from start to orderly stop."""

import asyncio
import socket
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from acquisition.clock import Clock
from core.alarms.alarm import PLANT
from service.app.measuring_process import Analysis, analysis_on, reporting_loops
from service.app.notifications import router_of
from service.app.process import Ground, Supervision, live_view
from service.app.service_audit import ServiceTrail
from service.app.serving_process import Serving, context_of, serving_of
from service.app.storage import database_path, evidence_desk, open_store
from service.app.web import access_desk
from service.measuring.acquirer import Bus
from service.measuring.analyser import BUS_CAPACITY, Runner
from service.measuring.sources import WatchedUnit
from service.measuring.timings import Timings, timed, timed_sources
from service.notifications.message import Around
from service.runtime.heartbeats import Heartbeats
from service.runtime.process import stop_on_signals
from service.runtime.service_manager import NO_MANAGER, ServiceManager
from service.settings.plant import PlantFile
from service.settings.storage import Origin
from service.store.holds import exclusive_use


@dataclass(frozen=True)
class Performance:
    """Configuration of a service run: a live plant, or recordings of it.

    Parameters
    ----------
    units
        Source and monitor of every unit of the plant.
    origin
        Origin of the data in its database and in its answers.
    ends
        Whether the service stops when all sources have ended.
    is_demo
        Whether local clients may do everything without a login.
    """

    plant: PlantFile
    units: Mapping[str, WatchedUnit]
    origin: Origin = Origin.LIVE
    ends: bool = False
    is_demo: bool = False


async def run_service(
    performance: Performance,
    listener: socket.socket,
    clock: Clock,
    announce: Callable[[str], None],
    manager: ServiceManager = NO_MANAGER,
) -> None:
    """Run until SIGINT or SIGTERM, or until all sources have ended if the run ends with them.

    Parameters
    ----------
    listener
        Socket of the HTTP server.
    announce
        Called with the URL once the server answers, then with the set-up token if there is no
        account.
    manager
        Notified when the service is ready, alive and stopping.

    Raises
    ------
    StoreError
        If the database cannot be used.
    ClosedError
        If the service would be reachable from other hosts without TLS or accounts.
    """
    plant, origin = performance.plant, performance.origin
    live = live_view(plant, clock)
    around = Around(live)
    with exclusive_use(database_path(plant)):
        store = open_store(plant, origin, router_of(plant, origin, around, clock))
        beats, timings = Heartbeats(clock), Timings(performance.units, clock)
        ground = Ground(plant, origin, clock, store, live, beats, timings)
        try:
            await _run(performance, ground, around, listener, announce, manager)
        finally:
            store.close()


async def _run(
    performance: Performance,
    ground: Ground,
    around: Around,
    listener: socket.socket,
    announce: Callable[[str], None],
    manager: ServiceManager,
) -> None:
    plant, clock = ground.plant, ground.clock
    desk = access_desk(plant, ground.store.access, clock, performance.is_demo)
    units = timed(performance.units, ground.timings)
    bus = Bus(BUS_CAPACITY, clock)
    monitors = {unit: watched.monitor for unit, watched in units.items()}
    analysis = await analysis_on(ground, monitors, bus, around)
    runner = _runner(units, analysis, bus)
    audit = ServiceTrail(plant, ground.origin, ground.store.audit, clock)
    await audit.begin()
    context = context_of(analysis, desk, audit.refusals, bus, timed_sources(units))
    evidence = evidence_desk(plant, ground.store, analysis.evidence, clock, context.downloads)
    serving = serving_of(context, ground, listener, desk, announce, evidence)
    supervision = Supervision(manager, ground.beats, ground.live, units, clock)
    try:
        await _perform(runner, analysis, audit, serving, supervision, ends=performance.ends)
    finally:
        desk.close()
        await analysis.close()
        await audit.end()


def _reporting(analysis: Analysis, tasks: asyncio.TaskGroup) -> list[asyncio.Task[None]]:
    """Start the loops that serve replicas; only PostgreSQL and live data have replicas."""
    ground = analysis.ground
    if ground.plant.store.postgresql is None or ground.origin is not Origin.LIVE:
        return []
    held = [*(unit.id for unit in ground.plant.unit), PLANT]
    loops = reporting_loops(analysis, lambda: held)
    beats = ground.beats
    return [tasks.create_task(beats.tend(name, loops[name]), name=name) for name in loops]


def _runner(units: Mapping[str, WatchedUnit], analysis: Analysis, bus: Bus) -> Runner:
    ground = analysis.ground
    return Runner(
        units,
        ground.live,
        analysis.recorder,
        ground.clock,
        analysis.alarms,
        analysis.films,
        bus,
        ground.beats,
    )


async def _perform(
    runner: Runner,
    analysis: Analysis,
    audit: ServiceTrail,
    serving: Serving,
    supervision: Supervision,
    *,
    ends: bool,
) -> None:
    """Run all parts until the service is stopped or its sources have ended."""
    stopped = stop_on_signals()
    watching = analysis.ground.beats.tend("clock", audit.watch_clock)
    async with asyncio.TaskGroup() as tasks:
        running = tasks.create_task(runner.run(), name="run")
        beside = [*analysis.start(tasks), *_reporting(analysis, tasks)]
        beside.append(tasks.create_task(watching, name="clock"))
        server = serving.start(tasks)
        announcing = tasks.create_task(serving.tell(supervision), name="announce")
        supervising = tasks.create_task(supervision.run(), name="supervise")
        if ends:
            running.add_done_callback(lambda _: stopped.set())
        await stopped.wait()
        supervision.stopping()
        serving.stop()
        for task in (running, *beside, announcing, supervising):
            task.cancel()
        await asyncio.wait([server])
