"""What webhooks and mail have in common below their protocols: TLS, connections, time-outs."""

import asyncio
import socket
import ssl
from dataclasses import dataclass
from pathlib import Path

from acquisition.delivery.network import NameLookUp


@dataclass(frozen=True)
class Timeouts:
    """How long a receiver may take.

    Parameters
    ----------
    connect_s
        To look its name up, and to connect to each of its addresses.
    answer_s
        Longest silence after that.
    total_s
        For all of an attempt.
    """

    connect_s: float = 10.0
    answer_s: float = 30.0
    total_s: float = 60.0


PATIENT = Timeouts()


class Trust:
    """Whose certificates are believed: the system's authorities, or those of one file."""

    def __init__(self, ca_file: Path | None = None) -> None:
        self._ca_file = ca_file
        self._context: ssl.SSLContext | None = None

    async def context(self) -> ssl.SSLContext:
        """Settings for TLS; certificate and name are always checked.

        Raises
        ------
        OSError
            If the file cannot be used; the message names it.
        """
        if self._context is None:
            self._context = await asyncio.to_thread(_context, self._ca_file)
        return self._context


def _context(ca_file: Path | None) -> ssl.SSLContext:
    try:
        return ssl.create_default_context(cafile=ca_file)
    except (OSError, ValueError) as error:  # ssl.SSLError is an OSError
        raise OSError(f"ca_file {ca_file}: {error}") from error


async def connected_socket(look_up: NameLookUp, port: int, timeout_s: float) -> socket.socket:
    """Connect to the first address of a name that answers.

    Raises
    ------
    OSError
        If none does; the last one's reason.
    """
    failure: OSError = OSError("has no address")
    async with asyncio.timeout(timeout_s):
        addresses = await look_up.addresses()
    for address in addresses:
        try:
            async with asyncio.timeout(timeout_s):
                return await _connected(address, port)
        except OSError as error:  # a time-out is one, too
            failure = error
    raise failure


async def _connected(address: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    sock = socket.socket(family, socket.SOCK_STREAM)
    try:
        sock.setblocking(False)
        await asyncio.get_running_loop().sock_connect(sock, (address, port))
    except BaseException:
        sock.close()
        raise
    return sock


def words(error: BaseException) -> str:
    """An error in words, whatever its class says about itself."""
    if isinstance(error, TimeoutError) and not str(error):
        return "no answer in time"
    said = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return said or type(error).__name__


def printable(text: str, longest: int = 200) -> str:
    """What somebody else has said, as one line that is safe to show."""
    one_line = " ".join(text.split())
    return "".join(c if c.isprintable() else "�" for c in one_line)[:longest]
