"""The port of the HTTP server, taken before anything else is started."""

import socket


class PortInUseError(Exception):
    """The HTTP port cannot be listened on; the message says which and why."""


def listen(host: str, port: int) -> socket.socket:
    """Take the HTTP port.

    Raises
    ------
    PortInUseError
        If it cannot be had.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return socket.create_server((host, port), family=family)
    except OSError as error:
        # what Python adds in brackets repeats the address
        why = (error.strerror or str(error)).partition(" (")[0]
        raise PortInUseError(f"cannot listen on {host} port {port}: {why}") from error


def url_of(listener: socket.socket, has_tls: bool = False) -> str:
    """Where the service is found."""
    if listener.family == socket.AF_UNIX:
        return f"unix:{listener.getsockname()}"
    host, port = listener.getsockname()[:2]
    place = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
    return f"{'https' if has_tls else 'http'}://{place}/"
