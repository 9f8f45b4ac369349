"""The serving part of a process, and `padwatch serve`, which reads all from the database."""

import asyncio
import gc
import socket
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from functools import partial

from acquisition.clock import Clock
from service.api.auth.authenticator import AccessDesk
from service.api.auth.refusals import Refusals
from service.api.context import Context
from service.api.http.listening import url_of
from service.api.http.server import GuardedServer
from service.api.load import Shedding
from service.app.measuring_process import Analysis
from service.app.metrics import Watched, scrape
from service.app.notifications import receivers_of
from service.app.process import STALE_HOPS, Ground, Supervision, live_view, refresh_s
from service.app.service_audit import ServiceTrail
from service.app.storage import evidence_folders, open_store, recordings_folder
from service.app.web import access_desk, application, server_of
from service.cluster.replica_state import (
    NoCaptures,
    ReplicaAlarms,
    ReplicaDeliveries,
    ReplicaFilms,
    ReplicaLive,
    ReplicaMetrics,
)
from service.cluster.reported_commands import Asking
from service.cluster.reported_state import Described, Feed
from service.measuring.acquirer import Bus
from service.measuring.commands import InProcess
from service.measuring.references_in_force import ReferencesInForce
from service.measuring.timings import Timings
from service.reports.routes import EvidenceService
from service.runtime.heartbeats import Heartbeats
from service.runtime.polls import TimedSource
from service.runtime.process import stop_on_signals
from service.runtime.service_manager import NO_MANAGER, ServiceManager
from service.settings.core_values import chatter_rule_of, machine_of
from service.settings.plant import PlantFile
from service.settings.storage import Origin
from service.store.store import Store

GC_THRESHOLDS = (20_000, 20, 20)
"""Rare collections: requests and blocks leave few reference cycles."""


@dataclass(frozen=True)
class Serving:
    """A server on a socket.

    Parameters
    ----------
    announce
        Called with the URL once the server answers, then with the set-up token if there is no
        account.
    afterwards
        Preparation that can follow the first answers; called once, in a thread.
    """

    ground: Ground
    server: GuardedServer
    listener: socket.socket
    desk: AccessDesk
    announce: Callable[[str], None]
    afterwards: Callable[[], object]

    def start(self, tasks: asyncio.TaskGroup) -> asyncio.Task[None]:
        """Start the server; the task ends after `stop`."""
        serve = partial(self.server.run_on, self.listener)
        return tasks.create_task(self.ground.beats.tend("serve", serve), name="serve")

    def stop(self) -> None:
        """Stop accepting requests."""
        self.server.should_exit = True

    async def tell(self, supervision: Supervision) -> None:
        """Announce the server as soon as it answers."""
        while not self.server.started:
            await asyncio.sleep(0.01)
        supervision.ready()
        self.announce(url_of(self.listener, has_tls=self.server.config.is_ssl))
        if token := await self.desk.offer_set_up():
            self.announce(f"to make the first account, within one hour and once: {token}")
        await asyncio.to_thread(self.afterwards)
        gc.collect()
        gc.freeze()  # objects of the start stay; a collection of them takes 0.1 s
        gc.set_threshold(*GC_THRESHOLDS)


def serving_of(
    context: Context,
    ground: Ground,
    listener: socket.socket,
    desk: AccessDesk,
    announce: Callable[[str], None],
    evidence: EvidenceService | None = None,
) -> Serving:
    """Build the server of a context; the OpenAPI document is rendered once, after the start."""
    app = application(context, evidence)
    asked = app if context.load is None else Shedding(app, context.load)
    server = server_of(asked, ground.plant, ground.clock)
    return Serving(ground, server, listener, desk, announce, afterwards=app.rendered)


def context_of(
    analysis: Analysis,
    desk: AccessDesk,
    refusals: Refusals,
    bus: Bus,
    sources: Mapping[str, TimedSource],
) -> Context:
    """Return the context of the API in a process that also analyses."""
    ground = analysis.ground
    plant = ground.plant
    return Context(
        plant_name=plant.plant.name,
        units={unit.id: unit for unit in plant.unit},
        live=ground.live,
        store=ground.store,
        clock=ground.clock,
        refresh_s=ground.refresh_s,
        references=analysis.references,
        alarms=analysis.alarms,
        films=analysis.films,
        operators=InProcess(analysis.alarms, analysis.films, analysis.recorder),
        captures=analysis.captures,
        deliveries=analysis.deliveries,
        evidence=lambda: analysis.evidence.status,
        configuration=analysis.evidence.configuration,
        metrics=partial(scrape, metrics_of(analysis, bus, sources)),
        origin=ground.origin,
        max_shelf_s=3600.0 * plant.alarms.max_shelf_h,
        sources=sources,
        loops=ground.beats.look,
        refusals=refusals,
        access=desk,
        space=analysis.space,
        load=analysis.load,
        tape=analysis.tape,
        recordings=(evidence_folders(plant).captures, recordings_folder(plant)),
        faults=lambda: analysis.recordings.faults,
        stored_trouble=lambda: analysis.soundness.trouble,
    )


def metrics_of(analysis: Analysis, bus: Bus, sources: Mapping[str, TimedSource]) -> Watched:
    """Return the sources of metrics in a process that analyses."""
    ground = analysis.ground
    return Watched(
        bearings={unit.id: [bearing.id for bearing in unit.bearing] for unit in ground.plant.unit},
        live=ground.live,
        bus=bus,
        recorder=analysis.recorder,
        alarms=analysis.alarms,
        films=analysis.films,
        captures=analysis.captures,
        evidence=analysis.evidence,
        deliveries=analysis.deliveries,
        timings=ground.timings,
        clock=ground.clock,
        sources=sources,
        space=analysis.space,
        load=analysis.load,
        tape=analysis.tape,
        recordings=analysis.recordings,
        soundness=analysis.soundness,
        store_kind=ground.store.kind,
    )


@dataclass(frozen=True)
class Replica:
    """State of a plant as other processes wrote it to the database."""

    plant: PlantFile
    store: Store
    clock: Clock
    live: ReplicaLive
    alarms: ReplicaAlarms
    films: ReplicaFilms
    feed: Feed
    references: ReferencesInForce
    deliveries: ReplicaDeliveries

    def checks(self) -> dict[str, str]:
        """Return the status of the analysis of each unit, in words."""
        return {f"analysis of {unit}": self._signs_of(unit) for unit in self._units}

    @property
    def _units(self) -> list[str]:
        return [unit.id for unit in self.plant.unit]

    def _signs_of(self, unit: str) -> str:
        silence_s = self.live.silence_s(unit)
        if silence_s is None:
            return "no sign of life yet"
        said = f"last sign of life {silence_s:.1f} s ago"
        return said if self.live.is_alive(unit) else f"silent: {said}"


async def replica_on(plant: PlantFile, store: Store, clock: Clock) -> Replica:
    """Build the parts and read the current state before the first request.

    Raises
    ------
    StoreError
        If the state cannot be read.
    """
    units = [unit.id for unit in plant.unit]
    live = ReplicaLive(units, clock, STALE_HOPS * refresh_s(plant))
    alarms = ReplicaAlarms(units, live.is_alive, chatter_rule_of(plant.alarms))
    films = ReplicaFilms(plant, store.films)
    feed = Feed(store, live, alarms, films, clock)
    await feed.start()
    references = ReferencesInForce(
        {unit.id: Described(machine_of(unit)) for unit in plant.unit}, store, clock
    )
    await references.look()
    receivers = receivers_of(plant, Origin.LIVE, clock)
    deliveries = ReplicaDeliveries(receivers, store.outbox)
    return Replica(plant, store, clock, live, alarms, films, feed, references, deliveries)


def replica_context(
    replica: Replica, desk: AccessDesk | None, refusals: Refusals | None, beats: Heartbeats
) -> Context:
    """Return the context of the API in a process that only serves."""
    plant = replica.plant
    bearings = {unit.id: [bearing.id for bearing in unit.bearing] for unit in plant.unit}
    seen = (replica.live, replica.alarms, replica.films, replica.deliveries, replica.clock)
    return Context(
        plant_name=plant.plant.name,
        units={unit.id: unit for unit in plant.unit},
        live=replica.live,
        store=replica.store,
        clock=replica.clock,
        refresh_s=refresh_s(plant),
        references=replica.references,
        alarms=replica.alarms,
        films=replica.films,
        operators=Asking(replica.store, replica.alarms, replica.clock),
        captures=NoCaptures(),
        deliveries=replica.deliveries,
        metrics=ReplicaMetrics(bearings, *seen, replica.store.kind).scrape,
        max_shelf_s=3600.0 * plant.alarms.max_shelf_h,
        loops=beats.look,
        checks=replica.checks,
        refusals=refusals,
        access=desk,
    )


async def run_serve(
    plant: PlantFile,
    listener: socket.socket,
    clock: Clock,
    announce: Callable[[str], None],
    manager: ServiceManager = NO_MANAGER,
) -> None:
    """Serve until SIGINT or SIGTERM.

    Parameters
    ----------
    listener
        Socket of the HTTP server.
    announce
        Called with the URL once the server answers.

    Raises
    ------
    StoreError
        If the database cannot be used.
    ClosedError
        If the service would be reachable from other hosts without TLS or accounts.
    """
    with closing(open_store(plant)) as store:
        await _run(plant, store, listener, clock, announce, manager)


async def _run(
    plant: PlantFile,
    store: Store,
    listener: socket.socket,
    clock: Clock,
    announce: Callable[[str], None],
    manager: ServiceManager,
) -> None:
    desk = access_desk(plant, store.access, clock)
    replica = await replica_on(plant, store, clock)
    beats = Heartbeats(clock)
    ground = Ground(
        plant, Origin.LIVE, clock, store, live_view(plant, clock), beats, Timings([], clock)
    )
    audit = ServiceTrail(plant, Origin.LIVE, store.audit, clock)
    await audit.begin()
    context = replica_context(replica, desk, audit.refusals, beats)
    serving = serving_of(context, ground, listener, desk, announce)
    supervision = Supervision(manager, beats, replica.live, [u.id for u in plant.unit], clock)
    try:
        await _perform(replica, serving, supervision, beats)
    finally:
        desk.close()
        await audit.end()


async def _perform(
    replica: Replica, serving: Serving, supervision: Supervision, beats: Heartbeats
) -> None:
    stopped = stop_on_signals()
    async with asyncio.TaskGroup() as tasks:
        loops = {"feed": replica.feed.run, "references": replica.references.run}
        beside = [tasks.create_task(beats.tend(name, loops[name]), name=name) for name in loops]
        server = serving.start(tasks)
        announcing = tasks.create_task(serving.tell(supervision), name="announce")
        supervising = tasks.create_task(supervision.run(), name="supervise")
        await stopped.wait()
        supervision.stopping()
        serving.stop()
        for task in (*beside, announcing, supervising):
            task.cancel()
        await asyncio.wait([server])
