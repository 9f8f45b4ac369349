"""`padwatch run` and `replay`: the measuring process, with the serving process as its child."""

import socket
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from functools import partial

from acquisition.clock import Clock
from core.alarms.alarm import PLANT
from service.app.listener import require_protected
from service.app.measuring_process import (
    ProcessContext,
    analysis_on,
    measuring_metrics,
    plant_snapshot,
    reporting_loops,
)
from service.app.notifications import router_of
from service.app.process import Supervision
from service.app.service_audit import ServiceTrail
from service.app.storage import database_path, open_access, open_store
from service.app.supervisor import ServingChild, Start
from service.live.alarm_list import SHARED
from service.measuring.acquirer import Bus
from service.measuring.analyser import BUS_CAPACITY, Runner
from service.measuring.commands import Questions
from service.measuring.live_view import LiveView
from service.measuring.snapshots import SocketReports
from service.measuring.sources import WatchedUnit, timed_sources
from service.notifications.message import LiveContext
from service.runtime.child import Child
from service.runtime.heartbeats import Heartbeats, Loop
from service.runtime.process import exempt_start
from service.runtime.service_manager import NO_MANAGER, ServiceManager
from service.settings.core_values import stale_after_s
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
    child
        Serving process that was started before; with None one is started.
    at_end
        Function called with the newest results when all sources have ended; None for no call.
    """

    plant: PlantFile
    units: Mapping[str, WatchedUnit]
    origin: Origin = Origin.LIVE
    ends: bool = False
    is_demo: bool = False
    child: Child | None = None
    at_end: Callable[[LiveView], None] | None = None


async def run_service(
    service_run: ServiceRun,
    listener: socket.socket,
    clock: Clock,
    announce: Callable[[str], None],
    manager: ServiceManager = NO_MANAGER,
) -> None:
    """Run the service until SIGINT or SIGTERM, or as configured until all sources have ended.

    Parameters
    ----------
    service_run, clock
        Configuration of the run, and the host clock.
    listener
        Listening socket, which the serving process inherits.
    announce
        Function that is called with the URL when requests are served, and with the set-up token if
        there is no account.
    manager
        Service manager, notified when the service is ready, alive and stopping.

    Raises
    ------
    StoreError
        If the database cannot be used.
    ClosedError
        If the service would be reachable from other hosts without TLS or accounts.
    """
    plant, origin = service_run.plant, service_run.origin
    live = LiveView([unit.id for unit in plant.unit], clock, stale_after_s(plant))
    beats = Heartbeats(clock)
    alarm_context = LiveContext(live.assessment)
    router = router_of(plant, origin, alarm_context, clock)
    with exclusive_use(database_path(plant)), closing(open_store(plant, origin, router)) as store:
        with closing(open_access(plant, origin)) as access:
            require_protected(plant, access)
        process = ProcessContext(plant, origin, clock, store, live, beats)
        units = service_run.units
        bus = Bus(BUS_CAPACITY, clock)
        monitors = {unit: watched.monitor for unit, watched in units.items()}
        analysis = await analysis_on(process, monitors, bus, alarm_context)
        runner = Runner(units, live, analysis.analyser, analysis.recorder, bus, beats, clock)
        audit = ServiceTrail(plant, origin, store.audit, clock)
        await audit.begin()
        sources, held = timed_sources(units), [*(unit.id for unit in plant.unit), PLANT]
        supervision = Supervision(manager, beats, live, units, clock)

        now = partial(plant_snapshot, analysis, sources)
        reports = SocketReports([*held, SHARED], analysis.snapshots, now, clock)
        metrics = partial(measuring_metrics, analysis, bus, sources)
        questions = Questions(analysis.executor, live, analysis.soundness, metrics)
        start = Start(plant, origin, service_run.is_demo)
        ready = partial(supervision.announce, announce)
        serving = ServingChild(
            *(start, listener, reports.report, questions.answer, ready, clock, service_run.child)
        )

        async def run() -> None:
            await runner.run()
            if service_run.at_end is not None:
                service_run.at_end(live)

        loops: dict[str, Loop] = {"clock": audit.watch_clock, "serve": serving.run}
        loops |= analysis.own_loops | analysis.shared_loops
        if plant.store.postgresql is not None and origin is Origin.LIVE:  # may have replicas
            loops |= reporting_loops(analysis, lambda: held)
        ends = service_run.ends
        exempt_start()
        try:
            await supervision.run_until_stopped(loops, run, lambda _: serving.stop(), ends=ends)
        finally:
            await analysis.close()
            await audit.end()
