"""Listening socket of the HTTP server, and the conditions under which it may be open."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from ssl import SSLContext

from service.runtime.listening import listen, server_tls, socket_file
from service.settings.plant import PlantFile
from service.settings.processes import is_loopback
from service.store.access.tables import AccessStore


class ClosedError(Exception):
    """Error raised if the service would be reachable from other hosts without an account."""


def require_protected(plant: PlantFile, store: AccessStore) -> None:
    """Check that a service that is reachable from other hosts has an account.

    The plant file requires TLS of such a service. A Unix socket is reachable only by a proxy.

    Raises
    ------
    ClosedError
        If the service would be reachable from other hosts without an account.
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
    tls_of(plant)
    if plant.service.socket is not None:
        with socket_file(Path(plant.service.socket)) as listener:
            yield listener
    else:
        with listen(plant.service.host, port) as listener:
            yield listener


def tls_of(plant: PlantFile) -> SSLContext | None:
    """Return the server's TLS context, or None; raise `CertificateError` if it cannot be made."""
    tls = plant.service.tls
    return None if tls is None else server_tls(Path(tls.certificate), Path(tls.key))
