"""Listening sockets of the HTTP server: TCP port, Unix socket file, TLS."""

import os
import socket
import ssl
import stat
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path


class PortInUseError(Exception):
    """Raised if a TCP port or Unix socket file cannot be opened; the message gives the reason."""


def listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens on a TCP port of an IPv4 or IPv6 address.

    Raises
    ------
    PortInUseError
        If the port cannot be opened.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return socket.create_server((host, port), family=family)
    except OSError as error:
        # omit the address, which Python repeats in brackets
        why = (error.strerror or str(error)).partition(" (")[0]
        raise PortInUseError(f"cannot listen on {host} port {port}: {why}") from error


def url_of(listener: socket.socket, has_tls: bool = False) -> str:
    """Return the URL of the service on a listening socket, or ``unix:PATH`` for a Unix socket."""
    if listener.family == socket.AF_UNIX:
        return f"unix:{listener.getsockname()}"
    host, port = listener.getsockname()[:2]
    place = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
    return f"{'https' if has_tls else 'http'}://{place}/"


MODE = 0o660
"""Mode of the socket file: access for the user padwatch and its group, with the proxy."""


@contextmanager
def socket_file(path: Path) -> Iterator[socket.socket]:
    """Return a context with a socket that listens on a Unix socket file, removed on exit.

    Raises
    ------
    PortInUseError
        If the file cannot be created, is not a socket, or is in use.
    """
    _remove_stale(path)
    with closing(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)) as listener:
        try:
            before = os.umask(0o777 & ~MODE)
            try:
                listener.bind(str(path))
            finally:
                os.umask(before)
            listener.listen(socket.SOMAXCONN)
        except OSError as error:
            raise PortInUseError(f"cannot listen on {path}: {error.strerror}") from error
        try:
            yield listener
        finally:
            path.unlink(missing_ok=True)


def _remove_stale(path: Path) -> None:
    """Remove a socket file on which no process listens, as after a crash; raise if it is in use."""
    try:
        mode = path.lstat().st_mode
    except OSError:
        return  # bind reports the error
    if not stat.S_ISSOCK(mode):
        raise PortInUseError(f"cannot listen on {path}: another file is there; remove or rename it")
    with closing(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)) as caller:
        try:
            caller.connect(str(path))
        except ConnectionRefusedError:
            path.unlink()
        except OSError as error:
            raise PortInUseError(f"cannot listen on {path}: {error.strerror}") from error
        else:
            raise PortInUseError(f"cannot listen on {path}: another program listens on it; stop it")


class CertificateError(Exception):
    """Raised if a TLS certificate or private key is unusable; the message gives the reason."""


def server_tls(certificate: Path, key: Path) -> ssl.SSLContext:
    """Return a TLS context of a server (TLS 1.2 or newer) for a certificate and its private key.

    Raises
    ------
    CertificateError
        If a file is unreadable or invalid, or the key does not match the certificate.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    context.set_alpn_protocols(["http/1.1"])
    for path in (certificate, key):
        _require_readable(path)
    try:
        # an empty passphrase keeps OpenSSL from prompting
        context.load_cert_chain(certificate, key, password="")
    except (ssl.SSLError, ValueError) as error:
        why = getattr(error, "reason", None) or str(error)
        raise CertificateError(
            f"service.tls: cannot load certificate {certificate} with key {key}: {why}; the key"
            " must belong to the certificate and have no passphrase"
        ) from error
    return context


def _require_readable(path: Path) -> None:
    try:
        with path.open("rb") as file:
            file.read(1)
    except OSError as error:
        raise CertificateError(f"service.tls: {path} cannot be read: {error.strerror}") from error
