"""Which addresses the service may be reached at, and what that needs."""

from dataclasses import dataclass
from ipaddress import ip_address


@dataclass(frozen=True)
class Doorway:
    """How the service would be reached.

    Parameters
    ----------
    host
        Address that it listens on.
    is_unix_socket
        Whether it listens on a unix socket instead, which only a trusted proxy can open.
    has_tls
        Whether it has a certificate and its key.
    has_account
        Whether anybody could log in.
    """

    host: str
    is_unix_socket: bool = False
    has_tls: bool = False
    has_account: bool = False


def is_loopback(host: str) -> bool:
    """Whether an address is reached from its own host alone.

    Of names only `localhost` is: what another one means is not padwatch's to say.
    """
    if host == "localhost":
        return True
    try:
        address = ip_address(host)
    except ValueError:
        return False
    return address.is_loopback


def why_closed(doorway: Doorway) -> str | None:
    """Why the service does not start at an address, in one sentence; None if it may."""
    if doorway.is_unix_socket or is_loopback(doorway.host):
        return None
    missing = [
        what
        for is_there, what in (
            (doorway.has_tls, "a certificate and its key in [service.tls]"),
            (doorway.has_account, "an account (padwatch users add PLANT NAME --role admin)"),
        )
        if not is_there
    ]
    if not missing:
        return None
    return (
        f'service.host "{doorway.host}" is reached from other hosts, which needs'
        f" {' and '.join(missing)}; else listen on 127.0.0.1, or on a unix socket behind a proxy"
    )
