"""Listening socket of the HTTP server, and the conditions under which it may be open."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from ssl import SSLContext

from service.runtime.listening import listen, server_tls, socket_file
from service.settings.plant import PlantFile
from service.settings.processes import ClosedError, why_closed
from service.store.access.tables import AccessStore


def require_protected(plant: PlantFile, store: AccessStore) -> None:
    """Check that the service is not reachable from other hosts without TLS or accounts.

    Raises
    ------
    ClosedError
        If the service would be reachable from other hosts without TLS or without an account.
    StoreError
        If accounts cannot be read.
    """
    service = plant.service
    reason = why_closed(
        service.host,
        is_unix_socket=service.socket is not None,
        has_tls=service.tls is not None,
        has_account=bool(store.accounts.all()),
    )
    if reason is not None:
        raise ClosedError(reason)


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
