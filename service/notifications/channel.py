"""Notification channels: protocol, outcomes of a delivery attempt, secrets, TLS, connections."""

import asyncio
import os
import socket
import ssl
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from acquisition.delivery.network import HostAddresses
from service.notifications.message import Message
from service.settings.notifications import SecretSettings


@dataclass(frozen=True)
class Delivered:
    """Outcome of a delivery attempt: the receiver accepted the message, with the reply `answer`."""

    answer: str


@dataclass(frozen=True)
class Refused:
    """Outcome of a delivery attempt: permanent rejection, with the reply `answer`."""

    answer: str


@dataclass(frozen=True)
class Failed:
    """Outcome of a delivery attempt: temporary failure, after which it is repeated.

    Parameters
    ----------
    answer
        Reply of the receiver, or reason of the failure.
    retry_after_s
        Minimum delay that the receiver requested; None if not requested.
    """

    answer: str
    retry_after_s: float | None = None


Outcome = Delivered | Refused | Failed


class Channel(Protocol):
    """Protocol of a notification channel, which sends messages to one receiver."""

    @property
    def address(self) -> str:
        """Address of the receiver, without secrets."""
        ...

    async def send(self, message: Message, body: str) -> Outcome:
        """Make one delivery attempt within the time-outs, and return its outcome.

        ``body`` is the serialized message.
        """
        ...


MAX_SECRET_BYTES = 8192


class SecretError(Exception):
    """Error raised if a secret cannot be read; the message has its location, not its content."""


def read_secret(settings: SecretSettings) -> str:
    """Read a secret from a file or an environment variable, without surrounding white space.

    Raises `SecretError` if the secret is missing or not a single printable line.
    """
    file = settings.file
    place = f"environment variable {settings.env}" if file is None else f"file {file}"
    try:
        if file is None:
            text = os.environ.get(settings.env or "", "")
        else:
            with Path(file).open("rb") as opened:
                text = opened.read(MAX_SECRET_BYTES).decode()
    except OSError as error:
        raise SecretError(f"{place} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise SecretError(f"{place} is not valid UTF-8; save it as UTF-8") from error
    text = text.strip()
    if not text or not text.isprintable():
        raise SecretError(f"{place} must hold a single line of printable text")
    return text


class TrustedAuthorities:
    """Trusted certificate authorities: those of `ca_file`, or those of the system if it is None."""

    def __init__(self, ca_file: str | None) -> None:
        self._ca_file = ca_file
        self._context: ssl.SSLContext | None = None

    async def context(self) -> ssl.SSLContext:
        """Return the TLS context, which always verifies certificate and host name.

        Raises `OSError` if the file cannot be used; the message contains its path.
        """
        if self._context is None:
            self._context = await asyncio.to_thread(_context, self._ca_file)
        return self._context


def _context(ca_file: str | None) -> ssl.SSLContext:
    try:
        return ssl.create_default_context(cafile=ca_file)
    except (OSError, ValueError) as error:  # ssl.SSLError is an OSError
        raise OSError(f"ca_file {ca_file} cannot be used: {error}") from error


async def connected_socket(look_up: HostAddresses, port: int, timeout_s: float) -> socket.socket:
    """Return a non-blocking socket connected to the first address that accepts a connection.

    `timeout_s` limits the name resolution and each attempt. Raises `OSError` if the name cannot be
    resolved, or the `OSError` of the last address if no address accepts a connection.
    """
    failure: OSError = OSError("the host has no address")
    for address in await look_up.within(timeout_s):
        try:
            async with asyncio.timeout(timeout_s):
                return await _connected(address, port)
        except OSError as error:  # includes time-outs
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


def error_text(error: BaseException) -> str:
    """Return the message of an exception; if empty, a text for time-outs, or the class name."""
    if isinstance(error, TimeoutError) and not str(error):
        return "no reply within the time-out"
    text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return text or type(error).__name__


def printable(text: str, max_chars: int = 200) -> str:
    """Return text as one line of printable characters, truncated to `max_chars`."""
    one_line = " ".join(text.split())
    return "".join(c if c.isprintable() else "�" for c in one_line)[:max_chars]
