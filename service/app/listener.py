"""Listening socket of the HTTP server, and the conditions under which it may be open."""

import socket
from contextlib import AbstractContextManager
from pathlib import Path
from ssl import SSLContext

from service.runtime.listening import listen, server_tls, socket_file
from service.settings.plant import PlantFile
from service.settings.processes import is_loopback
from service.store.access.tables import AccessStore


class ClosedError(Exception):
    """Error raised if other hosts could reach the service while no account exists."""


def require_protected(plant: PlantFile, store: AccessStore) -> None:
    """Check that an account exists if other hosts can reach the service.

    TLS is checked with the plant file. Only a reverse proxy can reach a Unix socket.

    Raises
    ------
    ClosedError
        If other hosts can reach the service and no account exists.
    StoreError
        If accounts cannot be read.
    """
    service = plant.service
    if service.socket is None and not is_loopback(service.host) and not store.accounts.all():
        raise ClosedError(
            f'service.host "{service.host}" is reachable from other hosts, which requires an'
            " account (padwatch users add PLANT NAME --role admin); else listen on 127.0.0.1, or"
            " on a Unix socket behind a reverse proxy"
        )


def listener_of(plant: PlantFile, port: int) -> AbstractContextManager[socket.socket]:
    """Open the listening socket of the server, before other parts of the process start.

    `port` replaces the TCP port in the plant file; it has no effect with a Unix socket. Raises
    `PortInUseError` or `CertificateError` if the address is in use, or the certificate cannot be
    used.
    """
    tls_of(plant)
    if plant.service.socket is not None:
        return socket_file(Path(plant.service.socket))
    return listen(plant.service.host, port)


def tls_of(plant: PlantFile) -> SSLContext | None:
    """Return the server's TLS context, None without TLS; raise `CertificateError` if unusable."""
    tls = plant.service.tls
    return None if tls is None else server_tls(Path(tls.certificate), Path(tls.key))
