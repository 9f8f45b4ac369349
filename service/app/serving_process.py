"""API server of a process, and `padwatch serve`, an API process that reads the database."""

import asyncio
import gc
import socket
from collections.abc import Callable, Mapping
from contextlib import closing
from functools import partial

from acquisition.clock import Clock
from service.api.auth.authenticator import Authenticator
from service.api.auth.refusals import Refusals
from service.api.context import Context
from service.api.load import LoadShedder
from service.app.measuring_process import Analysis
from service.app.metrics import scrape
from service.app.notifications import receivers_of
from service.app.process import (
    STALE_HOPS,
    ProcessContext,
    ProcessServer,
    Supervision,
    live_view,
    refresh_s,
    start_loops,
)
from service.app.service_audit import ServiceTrail
from service.app.storage import evidence_folders, open_store, recordings_folder
from service.app.web import access_desk, application, server_of
from service.cluster.replica_metrics import NoCaptures, ReplicaDeliveries, ReplicaMetrics
from service.cluster.replica_state import ReplicaAlarms, ReplicaFilms, ReplicaLive
from service.cluster.reported_commands import CommandClient
from service.cluster.reported_state import Feed, UnitDescription
from service.measuring.acquirer import Bus
from service.measuring.commands import LocalCommands
from service.measuring.references import ReferencesInForce
from service.measuring.timings import Timings
from service.reports.routes import EvidenceService
from service.runtime.heartbeats import Heartbeats
from service.runtime.polls import TimedSource
from service.runtime.service_manager import NO_MANAGER, ServiceManager
from service.settings.core_values import chatter_rule_of, machine_of
from service.settings.plant import PlantFile
from service.settings.storage import Origin
from service.store.store import Store

GC_THRESHOLDS = (20_000, 20, 20)
"""Garbage-collection thresholds: high, since requests and blocks leave few cycles."""


def serving_of(
    context: Context,
    process: ProcessContext,
    listener: socket.socket,
    desk: Authenticator,
    announce: Callable[[str], None],
    evidence: EvidenceService | None = None,
) -> ProcessServer:
    """Return the API server of a context; the OpenAPI document is rendered after the start.

    Parameters
    ----------
    announce
        Called with the URL when the server accepts requests, then with the set-up token if no
        account exists.
    """
    app = application(context, evidence)

    async def prepare() -> None:
        if token := await desk.offer_set_up():
            announce(f"token to create the first account, valid once within one hour: {token}")
        await asyncio.to_thread(app.rendered)
        gc.collect()
        gc.freeze()  # objects of the start are permanent; scanning them takes 0.1 s
        gc.set_threshold(*GC_THRESHOLDS)

    limited = app if context.load is None else LoadShedder(app, context.load)
    server = server_of(limited, process.plant, process.clock)
    return ProcessServer("serve", server, listener, announce, prepare)


def context_of(
    analysis: Analysis,
    desk: Authenticator,
    refusals: Refusals,
    bus: Bus,
    sources: Mapping[str, TimedSource],
) -> Context:
    """Return the API context of a process that also analyses."""
    process = analysis.process
    plant = process.plant
    return Context(
        plant_name=plant.plant.name,
        units={unit.id: unit for unit in plant.unit},
        live=process.live,
        store=process.store,
        clock=process.clock,
        refresh_s=refresh_s(plant),
        references=analysis.references,
        alarms=analysis.alarms,
        films=analysis.films,
        operators=LocalCommands(analysis.alarms, analysis.films, analysis.recorder),
        captures=analysis.captures,
        receivers=analysis.deliveries.look,
        evidence=lambda: analysis.evidence.status,
        configuration=analysis.evidence.configuration,
        metrics=partial(scrape, analysis, bus, sources),
        origin=process.origin,
        max_shelf_s=3600.0 * plant.alarms.max_shelf_h,
        sources=sources,
        loops=process.beats.look,
        refusals=refusals,
        access=desk,
        space=analysis.space,
        load=analysis.load,
        tape=analysis.tape,
        recordings=(evidence_folders(plant).captures, recordings_folder(plant)),
        faults=lambda: analysis.recordings.faults,
        stored_trouble=lambda: analysis.soundness.trouble,
    )


class Replica:
    """Replica of a plant's state, read from the database that other processes write."""

    def __init__(self, plant: PlantFile, store: Store, clock: Clock) -> None:
        self._plant, self._store, self._clock = plant, store, clock
        units = [unit.id for unit in plant.unit]
        self.live = ReplicaLive(units, clock, STALE_HOPS * refresh_s(plant))
        self.alarms = ReplicaAlarms(units, self.live.is_alive, chatter_rule_of(plant.alarms))
        self.films = ReplicaFilms(plant, store.films)
        self.feed = Feed(store, self.live, self.alarms, self.films, clock)
        machines = {unit.id: UnitDescription(machine_of(unit)) for unit in plant.unit}
        self.references = ReferencesInForce(machines, store, clock)
        receivers = receivers_of(plant, Origin.LIVE, clock)
        self.deliveries = ReplicaDeliveries(receivers, store.outbox)

    async def start(self) -> None:
        """Read the current state; to be called before the first request.

        Raises
        ------
        StoreError
            If the state cannot be read.
        """
        await self.feed.start()
        await self.references.look()

    def checks(self) -> dict[str, str]:
        """Return the status of each unit's analysis in words, by name of the check."""
        return {f"analysis of {unit.id}": self._signs_of(unit.id) for unit in self._plant.unit}

    def _signs_of(self, unit: str) -> str:
        silence_s = self.live.silence_s(unit)
        if silence_s is None:
            return "no heartbeat yet"
        said = f"last heartbeat {silence_s:.1f} s ago"
        return said if self.live.is_alive(unit) else f"silent: {said}"

    def context(
        self, desk: Authenticator | None, refusals: Refusals | None, beats: Heartbeats
    ) -> Context:
        """Return the API context of a process that does not analyse."""
        plant, store = self._plant, self._store
        bearings = {unit.id: [bearing.id for bearing in unit.bearing] for unit in plant.unit}
        seen = (self.live, self.alarms, self.films, self.deliveries, self._clock)
        return Context(
            plant_name=plant.plant.name,
            units={unit.id: unit for unit in plant.unit},
            live=self.live,
            store=store,
            clock=self._clock,
            refresh_s=refresh_s(plant),
            references=self.references,
            alarms=self.alarms,
            films=self.films,
            operators=CommandClient(store, self.alarms, self._clock),
            captures=NoCaptures(),
            receivers=self.deliveries.look,
            metrics=ReplicaMetrics(bearings, *seen, store.kind).scrape,
            max_shelf_s=3600.0 * plant.alarms.max_shelf_h,
            loops=beats.look,
            checks=self.checks,
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
    """Serve the API from the database until SIGINT or SIGTERM.

    Parameters
    ----------
    listener, announce
        As in `ProcessServer`.

    Raises
    ------
    StoreError
        If the database cannot be used.
    ClosedError
        If the service would be reachable from other hosts without TLS or accounts.
    """
    with closing(open_store(plant)) as store:
        desk = access_desk(plant, store.access, clock)
        replica = Replica(plant, store, clock)
        await replica.start()
        beats = Heartbeats(clock)
        process = ProcessContext(
            plant, Origin.LIVE, clock, store, live_view(plant, clock), beats, Timings([], clock)
        )
        audit = ServiceTrail(plant, Origin.LIVE, store.audit, clock)
        await audit.begin()
        context = replica.context(desk, audit.refusals, beats)
        server = serving_of(context, process, listener, desk, announce)
        supervision = Supervision(manager, beats, replica.live, [u.id for u in plant.unit], clock)
        loops = {"feed": replica.feed.run, "references": replica.references.run}
        try:
            await server.run(supervision, beats, lambda tasks, _: start_loops(loops, beats, tasks))
        finally:
            desk.close()
            await audit.end()
