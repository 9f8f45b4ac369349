"""HTTP server of a plant file: application, access control and socket."""

from collections.abc import Iterable
from urllib.parse import urlsplit

import structlog
from starlette.types import ASGIApp

from acquisition.clock import Clock
from service.api.answers import EDITION_HEADER, ORIGIN_HEADER
from service.api.app import GuardedApi, Repeating, create_app
from service.api.auth.authenticator import Authenticator
from service.api.context import Context
from service.api.server import HttpServer, TrustedProxy, http_server
from service.app.listener import tls_of
from service.dashboard.assets import StaticFiles, edition
from service.reports.routes import EvidenceService, evidence_router
from service.settings.plant import PlantFile
from service.settings.processes import is_loopback
from service.settings.storage import Origin
from service.store.access.identities import Role, SessionLimits
from service.store.access.tables import AccessStore

log = structlog.get_logger()

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
    names = [plant.service.host, *plant.service.hosts]
    if plant.delivery.dashboard_url is not None:
        names.append(urlsplit(plant.delivery.dashboard_url).hostname or "")
    return [name for name in names if name]


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
