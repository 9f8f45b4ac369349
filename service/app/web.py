"""The HTTP server of a plant file."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from ssl import SSLContext
from urllib.parse import urlsplit

from starlette.types import ASGIApp

from acquisition.clock import Clock
from service.api.http.listening import listen, server_tls, socket_file
from service.api.http.middleware import TrustedProxy
from service.api.http.protocol import GuardedConfig
from service.api.http.server import GuardedServer
from service.settings.plant import PlantFile

HSTS = ("Strict-Transport-Security", "max-age=31536000")
"""Browsers that have seen it once never ask in plain HTTP again."""


def server_of(app: ASGIApp, plant: PlantFile, clock: Clock) -> GuardedServer:
    """What serves an application within the plant file's limits, under the names it gives."""
    service, tls = plant.service, _tls(plant)
    if service.socket is not None:
        app = TrustedProxy(app)
    options = {} if tls is None else {"ssl_context_factory": lambda *_: tls, "headers": [HSTS]}
    config = GuardedConfig(app, service.limits, _names(plant), clock.monotonic_s, **options)
    return GuardedServer(config)


@contextmanager
def listener_of(plant: PlantFile, port: int) -> Iterator[socket.socket]:
    """Where the server is to listen, taken before anything else is started.

    Parameters
    ----------
    port
        Instead of the plant file's; of no matter on a socket file.

    Raises
    ------
    PortInUseError, CertificateError
        If it cannot be had, or not with this certificate.
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
    """Its own names, and the one that people are sent to by messages."""
    names = [plant.service.host, *plant.service.hosts]
    if plant.delivery.dashboard_url is not None:
        names.append(urlsplit(plant.delivery.dashboard_url).hostname or "")
    return [name for name in names if name]
