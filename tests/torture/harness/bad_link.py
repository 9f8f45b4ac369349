"""`BadLink`: a TCP proxy between a device and the service that treats the link as it is told."""

import asyncio
import random
import socket
import struct
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from enum import StrEnum

LATE_S = 0.2
"""Of three or four replies in a poll, more than there is from one poll to the next."""

FLIPPED_SHARE = 0.2
RESET_SHARE = 0.3


class Link(StrEnum):
    """How the link is."""

    WELL = "well"
    REFUSED = "nobody listens"
    RESET = "reset in the middle of replies"
    SWALLOWED = "half-open, silent"
    LATE = "every reply late"
    SLICED = "one byte at a time"
    DOUBLED = "every reply twice"
    FLIPPED = "bits flipped"
    TAKEN = "another master has its only place"
    ANOTHER = "another device has its address"


ELSEWHERE = (Link.TAKEN, Link.ANOTHER)


class BadLink:
    """Lives on an event loop of its own.

    Parameters
    ----------
    port
        Of the device.
    other_port
        Of another one, which may have its address for a while.
    """

    def __init__(self, port: int, seed: int, other_port: int) -> None:
        self._device_port, self._other_port = port, other_port
        self._random = random.Random(seed)  # noqa: S311  not a secret
        self._state = Link.WELL
        self._server: asyncio.Server | None = None
        self._writers: set[asyncio.StreamWriter] = set()
        self.port = 0

    async def become(self, state: Link) -> None:
        """Be so from now on; open connections feel it, too."""
        before, self._state = self._state, state
        if state is Link.REFUSED:
            await self._close()
            return
        if state in ELSEWHERE or before in ELSEWHERE:
            self._cut()
        if self._server is None:
            await self.listen()

    async def listen(self) -> None:
        """Take connections, always at the same port."""
        self._server = await asyncio.start_server(self._accept, "127.0.0.1", self.port)
        self.port = self._server.sockets[0].getsockname()[1]

    async def _close(self) -> None:
        if self._server is not None:
            self._server.close()
            self._server = None
        self._cut()

    def _cut(self) -> None:
        for writer in list(self._writers):
            _reset(writer)

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self._state is Link.TAKEN:
            writer.close()
            return
        port = self._other_port if self._state is Link.ANOTHER else self._device_port
        device_reader, device_writer = await asyncio.open_connection("127.0.0.1", port)
        ends = (writer, device_writer)
        self._writers.update(ends)
        ways = [
            asyncio.create_task(self._ask(reader, device_writer)),
            asyncio.create_task(self._reply(device_reader, writer)),
        ]
        await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
        for way in ways:
            way.cancel()
        await asyncio.wait(ways)
        for end in ends:
            end.close()
        self._writers.difference_update(ends)

    async def _ask(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError):
            while data := await reader.read(65_536):
                if self._state is not Link.SWALLOWED:
                    writer.write(data)
                    await writer.drain()

    async def _reply(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError):
            while data := await reader.read(65_536):
                if not await self._pass_on(data, writer):
                    return

    async def _pass_on(self, data: bytes, writer: asyncio.StreamWriter) -> bool:
        match self._state:
            case Link.SWALLOWED:
                return True
            case Link.RESET if self._random.random() < RESET_SHARE:
                writer.write(data[: len(data) // 2])
                _reset(writer)
                return False
            case Link.LATE:
                await asyncio.sleep(LATE_S)
            case Link.DOUBLED:
                data += data
            case Link.FLIPPED if self._random.random() < FLIPPED_SHARE:
                data = self._flipped(data)
        step = 1 if self._state is Link.SLICED else len(data)
        for start in range(0, len(data), step):
            writer.write(data[start : start + step])
            await writer.drain()
        return True

    def _flipped(self, data: bytes) -> bytes:
        wrong = bytearray(data)
        for _ in range(self._random.randint(1, 5)):
            wrong[self._random.randrange(len(wrong))] ^= 1 << self._random.randrange(8)
        return bytes(wrong)


def _reset(writer: asyncio.StreamWriter) -> None:
    """Close with a reset instead of an end."""
    own = writer.get_extra_info("socket")
    if own is not None and not writer.is_closing():
        own.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    writer.transport.abort()


class BadLinks:
    """A bad link to every device, told what to be from any thread."""

    def __init__(self, loop: asyncio.AbstractEventLoop, links: Mapping[str, BadLink]) -> None:
        self._loop, self._links = loop, links

    @property
    def ports(self) -> dict[str, int]:
        """Where the devices seem to be."""
        return {unit: link.port for unit, link in self._links.items()}

    def become(self, state: Link, *units: str) -> None:
        """Let links be so, all of them if none is named."""
        for unit in units or self._links:
            asyncio.run_coroutine_threadsafe(self._links[unit].become(state), self._loop).result(10)


@contextmanager
def bad_links(ports: Mapping[str, int], seed: int) -> Iterator[BadLinks]:
    """Put a proxy before every device."""
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever, name="bad links")
    thread.start()
    first, *rest = ports.values()
    others = [*rest, first]
    links = {
        unit: BadLink(port, seed + n, other)
        for n, ((unit, port), other) in enumerate(zip(ports.items(), others, strict=True))
    }
    try:
        for link in links.values():
            asyncio.run_coroutine_threadsafe(link.listen(), loop).result(10)
        yield BadLinks(loop, links)
    finally:
        asyncio.run_coroutine_threadsafe(_end(links), loop).result(10)
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()


async def _end(links: Mapping[str, BadLink]) -> None:
    for link in links.values():
        await link.become(Link.REFUSED)
    mine = asyncio.current_task()
    left = [task for task in asyncio.all_tasks() if task is not mine]
    for task in left:
        task.cancel()
    await asyncio.gather(*left, return_exceptions=True)
