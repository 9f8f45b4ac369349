"""`BadLink`: a TCP proxy between a device and the service that treats the link as it is told."""

import asyncio
import threading
from collections.abc import Coroutine, Iterator, Mapping
from contextlib import contextmanager
from enum import StrEnum
from typing import Any, Self

from rigs.tcp_proxy import MaliciousProxy

LATE_S = 0.2
"""Of three or four replies in a poll, more than there is from one poll to the next."""


class Link(StrEnum):
    """How the link is."""

    WELL = "well"
    REFUSED = "nobody listens"
    RESET = "reset instead of replies"
    SWALLOWED = "half-open, silent"
    LATE = "every reply late"
    SLICED = "some bytes at a time"
    DOUBLED = "every reply twice"
    FLIPPED = "bytes altered"
    TAKEN = "another master has its only place"
    ANOTHER = "another device has its address"


MISCHIEF = {
    Link.RESET: {"reset": 0.3},
    Link.SWALLOWED: {"swallow": 1.0},
    Link.SLICED: {"slice": 1.0},
    Link.DOUBLED: {"duplicate": 1.0},
    Link.FLIPPED: {"corrupt": 0.2},
}
CUT = {Link.REFUSED, Link.TAKEN, Link.ANOTHER}
"""As these begin or end, open connections are cut."""


class BadLink(MaliciousProxy):
    """Always at the same port.

    Parameters
    ----------
    port
        Of the device.
    other_port
        Of another one, which may have its address for a while.
    """

    def __init__(self, port: int, seed: int, other_port: int) -> None:
        super().__init__(port, seed)
        self._ports = {Link.ANOTHER: other_port}, port
        self._state = Link.WELL

    async def become(self, state: Link) -> None:
        """Be so from now on; open connections feel it, too."""
        before, self._state = self._state, state
        others, own = self._ports
        self._device_port = others.get(state, own)
        self.mischief = MISCHIEF.get(state, {})
        if {before, state} & CUT:
            for task in list(self._tasks):
                task.cancel()
        if state is Link.REFUSED:
            await self.__aexit__()
        elif before is Link.REFUSED:
            await self.__aenter__()

    async def __aenter__(self) -> Self:
        self._server = await asyncio.start_server(self._accept, "127.0.0.1", self.port)
        self.port = self._server.sockets[0].getsockname()[1]
        return self

    def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> Any:
        return writer.close() if self._state is Link.TAKEN else super()._accept(reader, writer)

    async def _reply(self, data: bytes, writer: asyncio.StreamWriter) -> None:
        if self._state is Link.LATE:
            await asyncio.sleep(LATE_S)
        await super()._reply(data, writer)


class BadLinks:
    """A bad link to every device, on an event loop of their own; for calls from any thread."""

    def __init__(self, ports: Mapping[str, int], seed: int) -> None:
        self._loop = asyncio.new_event_loop()
        first, *rest = ports.values()
        others = zip(ports.items(), [*rest, first], strict=True)
        self._links = {
            unit: BadLink(port, seed + n, other) for n, ((unit, port), other) in enumerate(others)
        }

    @property
    def ports(self) -> dict[str, int]:
        """Where the devices seem to be."""
        return {unit: link.port for unit, link in self._links.items()}

    def become(self, state: Link) -> None:
        """Let all links be so."""
        for link in self._links.values():
            self._run(link.become(state))

    @contextmanager
    def listening(self) -> Iterator["BadLinks"]:
        """Take connections."""
        thread = threading.Thread(target=self._loop.run_forever, name="bad links")
        thread.start()
        try:
            for link in self._links.values():
                self._run(link.__aenter__())
            yield self
        finally:
            self.become(Link.REFUSED)
            self._loop.call_soon_threadsafe(self._loop.stop)
            thread.join()
            self._loop.close()

    def _run(self, deed: Coroutine[object, object, object]) -> None:
        asyncio.run_coroutine_threadsafe(deed, self._loop).result(10)
