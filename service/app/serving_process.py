"""Serving process: API, dashboard, login and metrics, from reports of the measuring process."""

import asyncio
import json
import socket
import sys
from collections.abc import Awaitable, Callable, Iterable, Mapping
from contextlib import closing, suppress
from functools import partial
from typing import Any
from urllib.parse import urlsplit

import structlog
from starlette.types import ASGIApp

from acquisition.clock import Clock, SystemClock
from service.api.answers import EDITION_HEADER, ORIGIN_HEADER
from service.api.app import GuardedApi, Repeating, create_app
from service.api.auth.authenticator import Authenticator
from service.api.context import Context
from service.api.problems import ProblemError
from service.api.server import HttpServer, TrustedProxy, http_server
from service.app import storage
from service.app.listener import tls_of
from service.dashboard.assets import StaticFiles, compress_all, edition
from service.live.client import LiveClient
from service.live.commands import Operators
from service.live.exchange import MeasuringGoneError, ServingEnd, Start, VersionError, read_start
from service.live.metrics import add_plant
from service.live.receivers import with_backlogs
from service.live.references import ReferencesInForce
from service.live.snapshot import Report
from service.reports.archive import EvidenceArchive
from service.reports.routes import EvidenceService, evidence_router
from service.runtime.heartbeats import Heartbeats, Loop
from service.runtime.listening import url_of
from service.runtime.metrics import Families
from service.runtime.periodic import periodic
from service.runtime.process import (
    exempt_start,
    leave,
    run_to_its_end,
    set_up_logging,
    stop_on_signals,
)
from service.settings.core_values import machine_of, refresh_s
from service.settings.plant import PlantFile
from service.settings.processes import is_loopback
from service.settings.storage import Origin
from service.store.access.identities import Role, SessionLimits
from service.store.access.tables import AccessStore
from service.store.store import Store

log = structlog.get_logger()

WRONG_VERSION = 78
"""Exit code if the measuring process is of another version (EX_CONFIG of sysexits.h)."""


HSTS = ("Strict-Transport-Security", "max-age=31536000")
"""HTTP Strict Transport Security header: browsers then use HTTPS only."""


def server_of(
    app: ASGIApp, plant: PlantFile, origin: Origin, repeating: Repeating | None = None
) -> HttpServer:
    """Return an HTTP server for `app` with the limits, host names and TLS of the plant file.

    `repeating` is a function that wraps an application, given with the headers of its answers, in
    middleware that answers repeated requests from the cache; None without this middleware.
    """
    service, tls = plant.service, tls_of(plant)

    def around(complete: ASGIApp, added: Iterable[tuple[str, str]]) -> ASGIApp:
        if repeating is not None:
            complete = repeating(complete, added)
        return complete if service.socket is None else TrustedProxy(complete)

    headers = [(ORIGIN_HEADER, origin.value), (EDITION_HEADER, edition())]
    if tls is not None:
        headers.append(HSTS)
    return http_server(app, service.limits, _names(plant), headers, tls, around)


def _names(plant: PlantFile) -> list[str]:
    """Return the accepted host names: those of the service and of the dashboard URL."""
    dashboard = urlsplit(plant.delivery.dashboard_url or "").hostname
    return [name for name in (plant.service.host, *plant.service.hosts, dashboard) if name]


def access_desk(
    plant: PlantFile, store: AccessStore, clock: Clock, is_demo: bool = False
) -> Authenticator:
    """Return the authenticator of requests; log an error if its database may not be the newest.

    With `is_demo`, local clients have the admin role without a login.
    """
    if (difference := store.accept(clock.now_ns())) is not None:
        log.error(
            "the database of accounts may not be the newest; check accounts, logins and API keys",
            reason=difference,
        )
    service, access = plant.service, plant.access
    local_role: Role | None = Role.ADMIN if is_demo else Role.VIEWER
    if access.login or service.socket is not None or not is_loopback(service.host):
        local_role = None
    limits = SessionLimits(idle_s=60.0 * access.idle_min, absolute_s=3600.0 * access.longest_h)
    return Authenticator(store, clock, local_role, limits=limits)


def application(context: Context, evidence: EvidenceService | None = None) -> GuardedApi:
    """Return the ASGI application of API, evidence downloads and dashboard.

    `evidence` is the service for downloads of alarm evidence; None if no evidence is stored.
    """
    app = create_app(context, [evidence_router(context, evidence)])
    app.add_middleware(StaticFiles)
    return app


RENDER_AFTER_S = 5.0
"""Time after the start for which open pages, which all ask now, have the processor alone, s."""


async def _rendered(app: GuardedApi) -> None:
    await asyncio.sleep(RENDER_AFTER_S)
    await asyncio.to_thread(app.openapi)
    await asyncio.to_thread(compress_all)
    exempt_start()


async def serve_requests(
    context: Context,
    plant: PlantFile,
    listener: socket.socket,
    loops: Mapping[str, Loop],
    stopped: asyncio.Event,
    on_ready: Callable[[str, str | None], Awaitable[None]],
    evidence: EvidenceService | None = None,
) -> None:
    """Serve API and dashboard until `stopped` is set.

    `loops` run while it serves, by name. `on_ready` is called with URL and set-up token (None if an
    account exists) when requests are accepted.
    """
    app = application(context, evidence)
    server = server_of(app, plant, context.origin, app.repeating)
    beats, references = Heartbeats(context.clock), context.references
    try:
        await references.look()
        async with asyncio.TaskGroup() as tasks:
            running = beats.start({"references": references.run, **loops}, tasks)
            [serving] = beats.start({"serve": partial(server.run_on, listener)}, tasks)
            while not server.started:
                await asyncio.sleep(0.01)
            token = await context.access.run(context.access.offer_set_up)
            await on_ready(url_of(listener, has_tls=server.config.is_ssl), token)
            running.append(tasks.create_task(_rendered(app), name="document"))
            await stopped.wait()
            server.should_exit = True
            await asyncio.wait([serving])
            for task in running:
                task.cancel()
    finally:
        await context.access.close()


def context_of(
    plant: PlantFile, store: Store, live: LiveClient, operators: Operators, clock: Clock, **own: Any
) -> Context:
    """Return the context of the API; `own` are the fields that differ between the processes."""
    return Context(
        plant_name=plant.plant.name,
        units={unit.id: unit for unit in plant.unit},
        live=live.units,
        alarms=live.alarms,
        films=live.films,
        plant=lambda: live.plant,
        operators=operators,
        references=ReferencesInForce(map(machine_of, plant.unit), store, clock),
        store=store,
        clock=clock,
        refresh_s=refresh_s(plant),
        max_shelf_s=3600.0 * plant.alarms.max_shelf_h,
        **own,
    )


def evidence_of(plant: PlantFile, context: Context) -> EvidenceService:
    """Return the service for downloads of alarm evidence."""
    archive = EvidenceArchive(storage.evidence_folders(plant), context.store)
    parts = (plant.evidence.trend_days, context.clock, context.downloads)
    return EvidenceService(archive, lambda: context.plant().evidence, *parts)


ACCESS_EVERY_S = 10.0


async def report_access(access: AccessStore, exchange: ServingEnd) -> None:
    """Report a fault of the database of accounts, or that it has none, to the measuring process."""
    trouble = await asyncio.to_thread(lambda: access.trouble)
    with suppress(MeasuringGoneError):  # the next report repeats it
        await exchange.ask("access", json.dumps([trouble]))


async def serve_beside(
    start: Start,
    reader: asyncio.StreamReader,
    writer: asyncio.StreamWriter,
    listener: socket.socket,
    clock: Clock,
) -> None:
    """Serve requests until the measuring process, connected by `reader` and `writer`, ends."""
    plant, stopped = start.plant, stop_on_signals()
    with (
        closing(storage.open_store(plant, start.origin, only_reads=True)) as store,
        closing(storage.open_access(plant, start.origin)) as access,
    ):
        exchange = ServingEnd(writer)
        live = LiveClient(plant, store.films, clock, exchange.ask)
        live.alarms.take_stored(await asyncio.to_thread(store.alarms))
        operators = Operators(exchange.send, store, live.alarms)
        informed = asyncio.Event()

        async def take(report: Report) -> None:
            await live.take(report, is_direct=True)
            informed.set()

        listening = asyncio.create_task(exchange.run(reader, take), name="reports")
        listening.add_done_callback(lambda _: stopped.set())
        listening.add_done_callback(lambda _: informed.set())

        async def metrics() -> bytes:
            try:
                measured: bytes = await exchange.ask("metrics", "[]")
            except MeasuringGoneError as error:
                raise ProblemError(503, "No answer", str(error)) from error
            add_plant(families := Families(), live, plant)
            return families.text + measured

        async def ready(url: str, token: str | None) -> None:
            with suppress(MeasuringGoneError):
                await exchange.ask("ready", json.dumps([url, token]))

        context = context_of(
            *(plant, store, live, operators, clock),
            access=access_desk(plant, access, clock, start.is_demo),
            origin=start.origin,
            configuration=storage.built_configuration(plant),
            receivers=lambda: asyncio.to_thread(with_backlogs, live.plant.receivers, store.outbox),
            metrics=metrics,
            recordings=(storage.evidence_folders(plant).captures, storage.recordings_folder(plant)),
        )
        await informed.wait()
        report = partial(report_access, access, exchange)
        loops = {"access": partial(periodic, report, ACCESS_EVERY_S, clock)}
        evidence = evidence_of(plant, context)
        try:
            await serve_requests(context, plant, listener, loops, stopped, ready, evidence)
        finally:
            listening.cancel()


async def _main(connection: socket.socket, listener: socket.socket) -> None:
    reader, writer = await asyncio.open_connection(sock=connection)
    try:
        start = await read_start(reader)
    except VersionError as error:
        log.error(str(error))
        leave(WRONG_VERSION)
    await serve_beside(start, reader, writer, listener, SystemClock())


if __name__ == "__main__":
    set_up_logging()
    connection = socket.socket(fileno=int(sys.argv[1]))
    descriptors = socket.recv_fds(connection, 1, 1)[1]
    if descriptors:  # none if the measuring process could not start
        run_to_its_end(_main(connection, socket.socket(fileno=descriptors[0])))
    leave()
