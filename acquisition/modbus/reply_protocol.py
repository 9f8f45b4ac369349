"""`ReplyProtocol`: requests in flight, and the replies that come to them in the same order."""

import asyncio
import errno
import os
from collections import deque
from collections.abc import Sequence

from acquisition.errors import FrameError, LinkError
from acquisition.modbus.framing import Asked, Framing, RtuFraming, TcpFraming
from acquisition.modbus.transport import SerialTransport, Transport

CLOSED = "the device closed the connection"
_SHOWN_BYTES = 16


def reason_of(error: OSError | EOFError) -> str:
    """Why there is no connection, without what event loop and pyserial wrap around it."""
    code = error.errno if isinstance(error, OSError) else None
    if code == errno.EWOULDBLOCK:
        return "another program has the port"
    return os.strerror(code) if code is not None and code > 0 else str(error)


class SilenceError(LinkError):
    """A device did not answer in time."""


class ReplyProtocol(asyncio.Protocol):
    """One connection to a device.

    Attributes
    ----------
    unasked
        What came while nothing was in flight, as words; empty if nothing did.
    """

    def __init__(self, transport: Transport) -> None:
        is_line = isinstance(transport, SerialTransport)
        self._framing: Framing = RtuFraming() if is_line else TcpFraming()
        self._where = str(transport)
        self._transport: asyncio.Transport | None = None
        self._in_flight: deque[Asked] = deque()
        self._received = b""
        self._replies: list[bytes] = []
        self._done: asyncio.Future[list[bytes]] | None = None
        self._watch: asyncio.TimerHandle
        self.unasked = ""

    @property
    def is_open(self) -> bool:
        """Whether there is a connection."""
        return self._transport is not None and not self._transport.is_closing()

    def close(self) -> None:
        """Close the connection; again is harmless."""
        if self._transport is not None:
            self._transport.close()

    async def ask(self, burst: Sequence[Asked], timeout_s: float) -> list[bytes]:
        """Send requests at once; return the replies from their function codes on.

        Raises
        ------
        LinkError
            If the connection is closed, or the device does not answer each in time, counted from
            the answer before.
        FrameError
            If what comes is not the next answer, or came before anything was asked.
        """
        transport = self._transport
        if transport is None or transport.is_closing():
            raise LinkError(f"{self._where}: {CLOSED}")
        if self.unasked:
            raise FrameError(f"{self._where}: {self.unasked}")
        loop = asyncio.get_running_loop()
        self._done, self._replies, self._received = loop.create_future(), [], b""
        self._in_flight.extend(burst)
        self._watch_for(timeout_s)
        transport.write(b"".join([self._framing.frame(asked) for asked in burst]))
        try:
            return await self._done
        finally:
            self._watch.cancel()
            self._in_flight.clear()
            self._done = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin."""
        # uvloop's transports are asyncio.Transports by their methods, but not by their class
        self._transport = transport  # type: ignore[assignment]

    def connection_lost(self, exc: Exception | None) -> None:
        """Tell who waits for a reply at once."""
        self._fail(LinkError(f"{self._where}: {CLOSED}" + (f": {exc}" if exc else "")))

    def data_received(self, data: bytes) -> None:
        """Judge what came as replies to what is in flight."""
        if not self._in_flight:
            self.unasked = f"{len(data)} bytes came unasked: {data[:_SHOWN_BYTES].hex()}"
            return
        received = memoryview(self._received + data if self._received else data)
        try:
            self._received = bytes(received[self._take(received) :])
        except FrameError as fault:
            shown = bytes(received[:_SHOWN_BYTES]).hex()
            self._fail(FrameError(f"{self._where}: {fault}: {shown}"))

    def _take(self, received: memoryview) -> int:
        """Take whole replies; return how many bytes they fill."""
        at = 0
        while self._in_flight:
            found = self._framing.take(received[at:], self._in_flight[0])
            if found is None:
                return at
            n_bytes, pdu = found
            at += n_bytes
            self._in_flight.popleft()
            self._replies.append(bytes(pdu))
        if at < len(received):
            raise FrameError(f"{len(received) - at} bytes follow the reply")
        if self._done is not None and not self._done.done():
            self._done.set_result(self._replies)
        return at

    def _look_at_time(self, timeout_s: float, n_seen: int) -> None:
        """Give up if no reply has come since it was looked last."""
        if len(self._replies) == n_seen:
            self._fail(SilenceError(f"{self._where}: {self._no_answer(timeout_s)}"))
        else:
            self._watch_for(timeout_s)

    def _watch_for(self, timeout_s: float) -> None:
        loop = asyncio.get_running_loop()
        self._watch = loop.call_later(timeout_s, self._look_at_time, timeout_s, len(self._replies))

    def _no_answer(self, timeout_s: float) -> str:
        if self._received:
            return f"{len(self._received)} bytes of an answer, and no more within {timeout_s} s"
        return f"no answer within {timeout_s} s"

    def _fail(self, error: LinkError | FrameError) -> None:
        self._in_flight.clear()
        if self._done is not None and not self._done.done():
            self._done.set_exception(error)
