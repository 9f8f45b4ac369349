"""Complete service in one process: acquisition, analysis and API."""

import asyncio
import socket
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass

from acquisition.clock import Clock
from core.alarms.alarm import PLANT
from service.app.measuring_process import analysis_on, reporting_loops
from service.app.notifications import router_of
from service.app.process import ProcessContext, Supervision, live_view, start_loops
from service.app.service_audit import ServiceTrail
from service.app.serving_process import context_of, serving_of
from service.app.storage import database_path, evidence_desk, open_store
from service.app.web import access_desk
from service.measuring.acquirer import Bus
from service.measuring.analyser import BUS_CAPACITY, Runner
from service.measuring.sources import WatchedUnit
from service.measuring.timings import Timings, timed, timed_sources
from service.notifications.message import LiveContext
from service.runtime.heartbeats import Heartbeats, Loop
from service.runtime.service_manager import NO_MANAGER, ServiceManager
from service.settings.plant import PlantFile
from service.settings.storage import Origin
from service.store.holds import exclusive_use


@dataclass(frozen=True)
class ServiceRun:
    """Configuration of a service run with live data or with recordings.

    Parameters
    ----------
    units
        Source and monitor of every unit of the plant.
    origin
        Origin of the data in the database and in the API responses.
    ends
        Whether the service stops when all sources have ended.
    is_demo
        Whether local clients have the admin role without a login.
    """

    plant: PlantFile
    units: Mapping[str, WatchedUnit]
    origin: Origin = Origin.LIVE
    ends: bool = False
    is_demo: bool = False


async def run_service(
    service_run: ServiceRun,
    listener: socket.socket,
    clock: Clock,
    announce: Callable[[str], None],
    manager: ServiceManager = NO_MANAGER,
) -> None:
    """Run the service until SIGINT or SIGTERM, or with `ends` until all sources have ended.

    Parameters
    ----------
    listener, announce
        As in `ProcessServer`; `announce` is also called with the set-up token if there is no
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
    plant, origin = service_run.plant, service_run.origin
    live, beats, timings = (
        live_view(plant, clock),
        Heartbeats(clock),
        Timings(service_run.units, clock),
    )
    alarm_context = LiveContext(live)
    router = router_of(plant, origin, alarm_context, clock)
    with exclusive_use(database_path(plant)), closing(open_store(plant, origin, router)) as store:
        process = ProcessContext(plant, origin, clock, store, live, beats, timings)
        desk = access_desk(plant, store.access, clock, service_run.is_demo)
        units = timed(service_run.units, timings)
        bus = Bus(BUS_CAPACITY, clock)
        monitors = {unit: watched.monitor for unit, watched in units.items()}
        analysis = await analysis_on(process, monitors, bus, alarm_context)
        parts = (analysis.alarms, analysis.films, bus, beats)
        runner = Runner(units, live, analysis.recorder, clock, *parts)
        audit = ServiceTrail(plant, origin, store.audit, clock)
        await audit.begin()
        context = context_of(analysis, desk, audit.refusals, bus, timed_sources(units))
        evidence = evidence_desk(plant, store, analysis.evidence, clock, context.downloads)
        server = serving_of(context, process, listener, desk, announce, evidence)

        def begin(tasks: asyncio.TaskGroup, stopped: asyncio.Event) -> list[asyncio.Task[None]]:
            running = tasks.create_task(runner.run(), name="run")
            if service_run.ends:
                running.add_done_callback(lambda _: stopped.set())
            loops: dict[str, Loop] = {"clock": audit.watch_clock}
            if plant.store.postgresql is not None and origin is Origin.LIVE:  # may have replicas
                held = [*(unit.id for unit in plant.unit), PLANT]
                loops |= reporting_loops(analysis, lambda: held)
            return [running, *analysis.start(tasks), *start_loops(loops, beats, tasks)]

        try:
            await server.run(Supervision(manager, beats, live, units, clock), beats, begin)
        finally:
            desk.close()
            await analysis.close()
            await audit.end()
