"""The running service from start to end: store, runner, HTTP server, orderly stop."""

import asyncio
import gc
import signal
import socket
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

from acquisition.clock import Clock
from service.alarms.health import health_of
from service.alarms.start import alarm_engine
from service.api.access.desk import AccessDesk
from service.api.app import create_app
from service.api.context import Context
from service.bus import Bus
from service.conversion import analysis_of
from service.delivery.deliveries import Deliveries
from service.delivery.facts import Around
from service.films.keeper import FilmKeeper
from service.films.start import film_keeper
from service.heartbeats import Heartbeats
from service.http.listening import url_of
from service.http.server import GuardedServer
from service.instance import only_one
from service.live import LiveView
from service.metrics.timed import timed, timed_sources
from service.metrics.timings import Timings
from service.metrics.watched import Watched
from service.notify import NOBODY, ServiceManager
from service.origin import Origin
from service.recorder import Recorder
from service.references import ReferencesInForce
from service.rolling import Rolling
from service.runner import BUS_CAPACITY, Runner, WatchedUnit
from service.settings.modbus_sources import ModbusVectorSettings
from service.settings.plant import PlantFile
from service.store.port import Store
from service.supervision import Supervision
from service.wiring.access import access_desk
from service.wiring.audit import ServiceTrail
from service.wiring.captures import captures_of
from service.wiring.delivery import receivers_of, router_of
from service.wiring.evidence import evidence_desk, evidence_of, watch
from service.wiring.http import server_of
from service.wiring.sources import vector_rows
from service.wiring.stores import database_path, open_store

GC_THRESHOLDS = (20_000, 20, 20)
"""Seldom enough to cost nothing; what a request or a block leaves is mostly no cycle."""

STALE_HOPS = 2.5
"""A result older than this many refreshes is no longer current."""


@dataclass(frozen=True)
class Performance:
    """What a service runs: a plant live, or recordings of it.

    Parameters
    ----------
    units
        Source and monitor of every unit of the plant.
    origin
        What its database holds, and what all its answers say.
    ends
        Whether the service stops by itself when all sources have come to their end.
    """

    plant: PlantFile
    units: Mapping[str, WatchedUnit]
    origin: Origin = Origin.LIVE
    ends: bool = False


async def run_service(
    performance: Performance,
    listener: socket.socket,
    clock: Clock,
    announce: Callable[[str], None],
    manager: ServiceManager = NOBODY,
) -> None:
    """Run until SIGINT or SIGTERM, or until a performance that ends is over.

    Parameters
    ----------
    listener
        Where the HTTP server listens.
    announce
        Called with the URL once the server answers, and before with the token for setting up where
        everybody must log in and nobody can.
    manager
        Told when the service is ready, alive and stopping.

    Raises
    ------
    StoreError
        If the database cannot be used.
    ClosedError
        If others could reach the service, and it is not fit for that.
    """
    plant, origin = performance.plant, performance.origin
    live = LiveView([unit.id for unit in plant.unit], clock, STALE_HOPS * _refresh_s(plant))
    around = Around(live)
    with only_one(database_path(plant)):
        store = open_store(plant, origin, router_of(plant, origin, around, clock))
        try:
            await _run(performance, listener, clock, live, around, store, announce, manager)
        finally:
            store.close()


async def _run(
    performance: Performance,
    listener: socket.socket,
    clock: Clock,
    live: LiveView,
    around: Around,
    store: Store,
    announce: Callable[[str], None],
    manager: ServiceManager,
) -> None:
    plant, units = performance.plant, performance.units
    desk = access_desk(plant, store.access, clock)
    receivers = receivers_of(plant, performance.origin, clock)
    deliveries = Deliveries(receivers, store.outbox, clock)
    timings = Timings(units, clock)
    recorder = Recorder(store, live, clock, told=deliveries.wake, timed=timings.commits.timed)
    monitors = {unit: watched.monitor for unit, watched in units.items()}
    units = timed(units, timings)
    captures = captures_of(plant, performance.origin, clock)
    bus = Bus(BUS_CAPACITY, clock)
    look = health_of(units, live, recorder, captures, bus)
    alarms = await alarm_engine(
        plant, performance.origin, store, recorder.put, clock, captures, vector_rows(plant), look
    )
    machines = {unit: monitor.unit for unit, monitor in monitors.items()}
    films = await film_keeper(plant, machines, store.films, clock)
    around.watch_films(films.newest)
    evidence = evidence_of(plant, performance.origin, live, films, store, captures, clock)
    watch(evidence, alarms, captures, performance.origin)
    beats = Heartbeats(clock)
    supervision = Supervision(manager, beats, live, units, clock)
    runner = Runner(units, live, recorder, clock, alarms, films, bus, beats)
    references = ReferencesInForce(monitors, store, clock)
    await references.look()  # before the first result
    rolling = Rolling(store.rollups, clock)
    audit = ServiceTrail(plant, performance.origin, store.audit, clock)
    await audit.begin()
    context = Context(
        plant_name=plant.plant.name,
        units={unit.id: unit for unit in plant.unit},
        live=live,
        store=store,
        clock=clock,
        refresh_s=_refresh_s(plant),
        references=references,
        alarms=alarms,
        films=films,
        recorder=recorder,
        captures=captures,
        deliveries=deliveries,
        evidence=evidence_desk(plant, store, evidence, clock),
        metrics=Watched(
            bearings={unit.id: [bearing.id for bearing in unit.bearing] for unit in plant.unit},
            live=live,
            bus=bus,
            recorder=recorder,
            alarms=alarms,
            films=films,
            captures=captures,
            evidence=evidence,
            deliveries=deliveries,
            timings=timings,
            clock=clock,
            sources=timed_sources(units),
        ),
        origin=performance.origin,
        max_shelf_s=3600.0 * plant.alarms.max_shelf_h,
        sources=timed_sources(units),
        loops=beats.look,
        refusals=audit.refusals,
        access=desk,
    )
    app = create_app(context)
    app.openapi()  # kept from now on: no client waits for it, nor samples for a client
    server = server_of(app, plant, clock)
    stopped = _stop_on_signals()
    try:
        async with asyncio.TaskGroup() as tasks:
            running = tasks.create_task(runner.run(), name="run")
            looking = tasks.create_task(beats.tend("references", references.run), name="references")
            watching = tasks.create_task(beats.tend("alarms", alarms.run), name="alarms")
            capturing = tasks.create_task(beats.tend("captures", captures.run), name="captures")
            witnessing = tasks.create_task(beats.tend("evidence", evidence.run), name="evidence")
            learning = tasks.create_task(_learn(films, performance.origin, beats), name="learn")
            gathering = tasks.create_task(beats.tend("gather", rolling.run), name="gather")
            delivering = tasks.create_task(deliveries.run(beats), name="deliver")
            serving = tasks.create_task(
                beats.tend("serve", partial(server.run_on, listener)), name="serve"
            )
            announcing = tasks.create_task(
                _announce(server, listener, announce, supervision, desk), name="announce"
            )
            supervising = tasks.create_task(supervision.run(), name="supervise")
            if performance.ends:
                running.add_done_callback(lambda _: stopped.set())
            await stopped.wait()
            supervision.stopping()
            server.should_exit = True
            helping = (capturing, witnessing, learning, delivering, announcing, supervising)
            for task in (running, looking, watching, gathering, *helping):
                task.cancel()
            await asyncio.wait([serving])
    finally:
        desk.close()
        await captures.close()
        await recorder.flush()  # also when a bug ends the program
        await evidence.close()
        await audit.end()


async def _learn(films: FilmKeeper, origin: Origin, beats: Heartbeats) -> None:
    """Learn baselines; what a replay shows is no history of a machine."""
    if origin is Origin.LIVE:
        await beats.tend("learn", films.run)


def _refresh_s(plant: PlantFile) -> float:
    """Seconds from one result to the next, of the slowest unit."""
    hop_samples = analysis_of(plant.analysis).hop_samples
    return max(
        (unit.source.hop_polls if isinstance(unit.source, ModbusVectorSettings) else hop_samples)
        / unit.sampling_hz
        for unit in plant.unit
    )


def _stop_on_signals() -> asyncio.Event:
    stopped = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stopped.set)
    return stopped


async def _announce(
    server: GuardedServer,
    listener: socket.socket,
    announce: Callable[[str], None],
    supervision: Supervision,
    desk: AccessDesk,
) -> None:
    while not server.started:
        await asyncio.sleep(0.01)
    gc.collect()
    gc.freeze()  # what is there from the start stays: looking through it again would take 0.1 s
    gc.set_threshold(*GC_THRESHOLDS)
    supervision.ready()
    if token := await desk.offer_set_up():
        announce(f"to make the first account, within one hour and once: {token}")
    announce(url_of(listener, has_tls=server.config.is_ssl))
