"""What every channel shares: outcomes of an attempt, secrets, TLS, connections, time-outs."""

import asyncio
import os
import socket
import ssl
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from acquisition.delivery.network import NameLookUp
from service.notifications.message import Message


@dataclass(frozen=True)
class Delivered:
    """The receiver has taken it."""

    answer: str


@dataclass(frozen=True)
class Refused:
    """The receiver will never take it."""

    answer: str


@dataclass(frozen=True)
class Failed:
    """It may take it later.

    Parameters
    ----------
    retry_after_s
        When it has asked to be tried again; None if it has not.
    """

    answer: str
    retry_after_s: float | None = None


Outcome = Delivered | Refused | Failed


class Carrier(Protocol):
    """Carries messages to one receiver."""

    async def carry(self, message: Message, body: str) -> Outcome:
        """Try once; ends within its time-outs, whatever the receiver does.

        Parameters
        ----------
        body
            The same message as it was written down.
        """
        ...


MAX_BYTES = 8192


class SecretError(Exception):
    """A secret cannot be read; the message says from where, never what."""


@dataclass(frozen=True)
class Secret:
    """Where a secret is: a file, or a variable of the environment.

    Parameters
    ----------
    file, env
        One of them.
    """

    file: Path | None = None
    env: str | None = None

    def read(self) -> str:
        """Read it, without the line's end that editors add.

        Raises
        ------
        SecretError
            If there is none, or it is no printable line.
        """
        text = self._text().strip()
        if not text or not text.isprintable():
            raise SecretError(f"{self._place} holds no single line of printable text")
        return text

    @property
    def _place(self) -> str:
        return f"file {self.file}" if self.file is not None else f"environment variable {self.env}"

    def _text(self) -> str:
        if self.file is None:
            return os.environ.get(self.env or "", "")
        try:
            with self.file.open("rb") as file:
                return file.read(MAX_BYTES).decode()
        except OSError as error:
            raise SecretError(f"{self._place}: {error.strerror}") from error
        except UnicodeDecodeError as error:
            raise SecretError(f"{self._place} is not UTF-8 text") from error


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
