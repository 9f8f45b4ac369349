"""HTTP server of a plant file: application, access control and socket."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from ssl import SSLContext
from urllib.parse import urlsplit

from fastapi import Depends
from starlette.types import ASGIApp

from acquisition.clock import Clock
from service.api.answers import EDITION_HEADER
from service.api.app import GuardedApi, create_app
from service.api.auth.authenticator import Authenticator
from service.api.context import Context
from service.api.http.listening import listen, server_tls, socket_file
from service.api.http.middleware import AddedHeaders, TrustedProxy
from service.api.http.protocol import GuardedConfig
from service.api.http.server import GuardedServer
from service.api.problems import refuse_unknown_parameters
from service.dashboard.assets import edition
from service.dashboard.routes import dashboard_router
from service.reports.routes import EvidenceService, evidence_router
from service.settings.plant import PlantFile
from service.settings.processes import is_loopback, why_closed
from service.store.access.identities import Role, SessionLimits
from service.store.access.tables import AccessStore

HSTS = ("Strict-Transport-Security", "max-age=31536000")
"""HTTP Strict Transport Security header: browsers then use HTTPS only."""


def server_of(app: ASGIApp, plant: PlantFile, clock: Clock) -> GuardedServer:
    """Return the server of an application with the limits and host names of the plant file."""
    service, tls = plant.service, _tls(plant)
    if service.socket is not None:
        app = TrustedProxy(app)
    options = {} if tls is None else {"ssl_context_factory": lambda *_: tls, "headers": [HSTS]}
    config = GuardedConfig(app, service.limits, _names(plant), clock.monotonic_s, **options)
    return GuardedServer(config)


@contextmanager
def listener_of(plant: PlantFile, port: int) -> Iterator[socket.socket]:
    """Open the listening socket of the server; to be called before other parts start.

    Parameters
    ----------
    port
        TCP port, instead of the port in the plant file; ignored with a Unix socket.

    Raises
    ------
    PortInUseError, CertificateError
        If the address is in use, or the certificate cannot be used.
    """
    _tls(plant)
    if plant.service.socket is not None:
        with socket_file(Path(plant.service.socket)) as listener:
            yield listener
    else:
        with listen(plant.service.host, port) as listener:
            yield listener


def _tls(plant: PlantFile) -> SSLContext | None:
    tls = plant.service.tls
    return None if tls is None else server_tls(Path(tls.certificate), Path(tls.key))


def _names(plant: PlantFile) -> list[str]:
    """Return the accepted host names: those of the service and of the dashboard URL."""
    names = [plant.service.host, *plant.service.hosts]
    if plant.delivery.dashboard_url is not None:
        names.append(urlsplit(plant.delivery.dashboard_url).hostname or "")
    return [name for name in names if name]


class ClosedError(Exception):
    """The service would be reachable from other hosts without TLS or accounts."""


def access_desk(
    plant: PlantFile, store: AccessStore, clock: Clock, is_demo: bool = False
) -> Authenticator:
    """Return the authenticator of requests.

    Parameters
    ----------
    is_demo
        Whether local clients have the admin role without a login.

    Raises
    ------
    ClosedError
        If the service would be reachable from other hosts without TLS or accounts.
    StoreError
        If accounts cannot be read.
    """
    service, access = plant.service, plant.access
    is_unix_socket = service.socket is not None
    reason = why_closed(
        service.host,
        is_unix_socket=is_unix_socket,
        has_tls=service.tls is not None,
        has_account=bool(store.accounts.all()),
    )
    if reason is not None:
        raise ClosedError(reason)
    local_role: Role | None = Role.ADMIN if is_demo else Role.VIEWER
    if access.login or is_unix_socket or not is_loopback(service.host):
        local_role = None
    limits = SessionLimits(idle_s=60.0 * access.idle_min, absolute_s=3600.0 * access.longest_h)
    return Authenticator(store, clock, local_role, limits=limits)


def application(context: Context, evidence: EvidenceService | None = None) -> GuardedApi:
    """Return the ASGI application of API, evidence downloads and dashboard.

    Parameters
    ----------
    evidence
        Service for downloads of alarm evidence; None if no evidence is stored.
    """
    app = create_app(context)
    app.add_middleware(AddedHeaders, headers=[(EDITION_HEADER, edition())])
    guarded = [Depends(refuse_unknown_parameters)]
    app.include_router(evidence_router(context, evidence), dependencies=guarded)
    app.include_router(dashboard_router())
    app.require_declarations()
    return app
