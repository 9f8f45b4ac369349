"""Base class of the servers of simulated DAQs, and pseudo-terminal for serial protocols."""

import asyncio
import os
import tty
from abc import ABC, abstractmethod
from collections.abc import Callable, Coroutine, Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from acquisition.errors import ConfigError, LinkError

_TERMINALS = "/dev/pts/"
_READ_BYTES = 4096


class DaqServer(ABC):
    """Base class of the servers of simulated devices, as asynchronous context managers.

    Entering opens the link, exiting closes it; a server can be entered again.

    Raises
    ------
    LinkError, ConfigError
        On entering, if the link cannot be opened.
    """

    def __init__(self) -> None:
        self._tasks: list[asyncio.Task[None]] = []

    @property
    @abstractmethod
    def endpoint(self) -> Mapping[str, str | int]:
        """Link settings of a source for this device, by key; valid after entering."""

    @abstractmethod
    async def run(self) -> None:
        """Serve until cancelled, or until the end of the feed of the device."""

    def inject(self, fault: str, count: int = 1) -> None:
        """Inject the fault with the name `fault` into the device or its link, `count` times.

        Raises LookupError if the fault is unknown; the message contains the known faults.
        """
        known = self._faults_by_name()
        if fault not in known:
            raise LookupError(f"unknown fault {fault}; known faults: {', '.join(sorted(known))}")
        known[fault](count)

    async def __aenter__(self) -> Self:
        await self._plug_in()
        self._tasks = [asyncio.create_task(job, name="simulated daq") for job in self._jobs()]
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for task in self._tasks:
            task.cancel()
        if self._tasks:
            await asyncio.wait(self._tasks)
        await self._pull_out()

    @abstractmethod
    def _faults_by_name(self) -> Mapping[str, Callable[[int], None]]:
        """Return the functions that inject faults, by fault name; their argument is a count."""

    @abstractmethod
    def _jobs(self) -> list[Coroutine[Any, Any, None]]:
        """Return the coroutines to run while the link is open."""

    @abstractmethod
    async def _plug_in(self) -> None:
        """Open the link."""

    @abstractmethod
    async def _pull_out(self) -> None:
        """Close the link."""


class PseudoTerminal:
    """Pseudo-terminal as a serial line to one client, without bit rate and parity.

    Parameters
    ----------
    link
        Path of a symbolic link to the open terminal. None for no link; the system then assigns a
        new path each time the terminal is opened.
    received
        Function that is called with the bytes from the client.
    """

    def __init__(self, link: Path | None, received: Callable[[bytes], None]) -> None:
        self._link = link
        self._received = received
        self._path = ""
        self._ends: tuple[int, int] | None = None
        self._writable = asyncio.Event()

    @property
    def name(self) -> str:
        """Path that a client opens."""
        return str(self._link or self._path)

    def open(self) -> None:
        """Open a terminal and create the link; replace an existing link to a terminal.

        Raises
        ------
        ConfigError
            If the path of the link is in use, for example by the port of a real device.
        LinkError
            If terminal or link cannot be created.
        """
        try:
            self._ends = ours, theirs = os.openpty()
        except OSError as exc:
            raise LinkError(f"cannot create a pseudo-terminal: {exc.strerror}") from exc
        self._path = os.ttyname(theirs)
        tty.setraw(theirs)
        os.set_blocking(ours, False)
        asyncio.get_running_loop().add_reader(ours, self._read)
        if self._link is not None:
            try:
                _set_link(self._link, self._path)
            except (ConfigError, LinkError):
                self.close()
                raise

    def close(self) -> None:
        """Close the terminal and remove the link; no effect on a closed terminal."""
        if self._ends is None:
            return
        loop = asyncio.get_running_loop()
        loop.remove_reader(self._ends[0])
        loop.remove_writer(self._ends[0])
        for end in self._ends:
            os.close(end)
        self._ends = None
        self._writable.set()
        if self._link is not None:
            _remove_link(self._link)

    def write(self, data: bytes) -> bytes:
        """Write bytes without blocking; return the bytes that were not written."""
        if self._ends is not None:
            with suppress(BlockingIOError):
                return data[os.write(self._ends[0], data) :]
        return data

    async def writable(self) -> None:
        """Wait until the terminal accepts more bytes, or is closed."""
        if self._ends is None:
            return
        loop, ends = asyncio.get_running_loop(), self._ends
        self._writable.clear()
        loop.add_writer(ends[0], self._writable.set)
        try:
            await self._writable.wait()
        finally:
            if ends is self._ends:
                loop.remove_writer(ends[0])

    def _read(self) -> None:
        if self._ends is not None:
            with suppress(BlockingIOError):
                self._received(os.read(self._ends[0], _READ_BYTES))


def _set_link(link: Path, terminal: str) -> None:
    try:
        if os.path.lexists(link) and not _leads_to_terminal(link):
            raise ConfigError(
                f"{link}: the path is in use; the link of a simulated DAQ requires a free path such"
                ' as "/tmp/line7", or "pty" for none'
            )
        _remove_link(link)
        link.symlink_to(terminal)
    except OSError as exc:
        raise LinkError(f"{link}: the link cannot be created: {exc.strerror}") from exc


def _remove_link(link: Path) -> None:
    if _leads_to_terminal(link):
        link.unlink(missing_ok=True)


def _leads_to_terminal(link: Path) -> bool:
    return link.is_symlink() and str(link.readlink()).startswith(_TERMINALS)
