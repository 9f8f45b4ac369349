"""`ReplyProtocol`: exchange of requests and replies; `SerialLine`: transport of a serial port."""

import asyncio
import errno
import os
import termios
from collections import deque
from collections.abc import Sequence

import serial

from acquisition.errors import ConfigError, FrameError, LinkError
from acquisition.modbus.framing import Framing, PendingRequest, RtuFraming, TcpFraming
from acquisition.modbus.transport import SerialTransport, Transport

CLOSED = "the device closed the connection"
_SHOWN_BYTES = 16
_RECEIVE_BYTES = 1024


def reason_of(error: OSError | EOFError) -> str:
    """Return the cause of a failed connection, without text added by asyncio or pyserial."""
    code = error.errno if isinstance(error, OSError) else None
    if code == errno.EWOULDBLOCK:
        return "the port is in use by another program"
    return os.strerror(code) if code is not None and code > 0 else str(error)


class SilenceError(LinkError):
    """Error raised if the device did not reply within the timeout."""


class ReplyProtocol(asyncio.Protocol):
    """asyncio protocol of a connection to a device; matches replies to requests in order.

    Attributes
    ----------
    n_in_flight
        Number of requests in the last burst, which were sent together.
    unsolicited
        Description of bytes received while no request was in flight; empty if there were none.
    """

    def __init__(self, transport: Transport) -> None:
        is_line = isinstance(transport, SerialTransport)
        self._framing: Framing = RtuFraming() if is_line else TcpFraming()
        self._where = str(transport)
        self._transport: asyncio.Transport | None = None
        self._in_flight: deque[PendingRequest] = deque()
        self._unsent: Sequence[PendingRequest] = ()
        self._max_in_flight = 1
        self._received = b""
        self._replies: list[bytes] = []
        self._done: asyncio.Future[list[bytes]] | None = None
        self._timeout_s = 0.0
        self._deadline: asyncio.Timeout
        self.n_in_flight = 0
        self.unsolicited = ""

    @property
    def is_open(self) -> bool:
        """Whether the connection is open."""
        return self._transport is not None and not self._transport.is_closing()

    def close(self) -> None:
        """Close the connection; no effect on a closed connection."""
        if self._transport is not None:
            self._transport.close()

    async def exchange(
        self, requests: Sequence[PendingRequest], max_in_flight: int, timeout_s: float
    ) -> list[bytes]:
        """Send requests in bursts; return the PDUs of their replies in the same order.

        Each burst of up to `max_in_flight` requests is sent in one write, after all replies to the
        burst before it.

        Raises
        ------
        LinkError
            If the connection is closed, or a reply takes longer than `timeout_s`, counted from the
            previous reply.
        FrameError
            If the received bytes are not the next reply, or arrived before any request.
        """
        self.n_in_flight = 0
        if not self.is_open:
            raise LinkError(f"{self._where}: {CLOSED}")
        if self.unsolicited:
            raise FrameError(f"{self._where}: {self.unsolicited}")
        loop = asyncio.get_running_loop()
        self._done, self._replies, self._received = loop.create_future(), [], b""
        self._unsent, self._max_in_flight, self._timeout_s = requests, max_in_flight, timeout_s
        try:
            async with asyncio.timeout(timeout_s) as self._deadline:
                self._send_burst()
                return await self._done
        except TimeoutError:
            words = f"no reply within {timeout_s} s"
            if self._received:
                words = f"incomplete reply of {len(self._received)} bytes within {timeout_s} s"
            raise SilenceError(f"{self._where}: {words}") from None
        finally:
            self._in_flight.clear()
            self._unsent = ()
            self._done = None

    def _send_burst(self) -> None:
        """Send the next requests together."""
        burst = self._unsent[: self._max_in_flight]
        self._unsent, self.n_in_flight = self._unsent[len(burst) :], len(burst)
        self._in_flight.extend(burst)
        if self._transport is not None:
            self._transport.write(b"".join(map(self._framing.frame, burst)))

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Store the transport of the new connection."""
        # uvloop's transports have the methods of asyncio.Transport, but are no subclasses
        self._transport = transport  # type: ignore[assignment]

    def connection_lost(self, exc: Exception | None) -> None:
        """End the current exchange, if any, with a LinkError."""
        self._fail(LinkError(f"{self._where}: {CLOSED}" + (f": {exc}" if exc else "")))

    def data_received(self, data: bytes) -> None:
        """Parse received bytes as replies to the requests in flight."""
        if not self._in_flight:
            self.unsolicited = f"{len(data)} unsolicited bytes: {data[:_SHOWN_BYTES].hex()}"
            return
        received = self._received + data if self._received else data
        try:
            n_taken = self._take(received)
            self._received = received[n_taken:]
            if n_taken and self._in_flight and not self._deadline.expired():
                now_s = asyncio.get_running_loop().time()
                self._deadline.reschedule(now_s + self._timeout_s)
        except FrameError as fault:
            shown = received[:_SHOWN_BYTES].hex()
            self._fail(FrameError(f"{self._where}: {fault}: {shown}"))

    def _take(self, received: bytes) -> int:
        """Store the complete replies in received bytes; return the number of bytes they occupy."""
        at, view = 0, memoryview(received)
        while self._in_flight:
            found = self._framing.take(view[at:], self._in_flight[0])
            if found is None:
                return at
            n_bytes, reply = found
            at += n_bytes
            self._in_flight.popleft()
            self._replies.append(reply)
        if at < len(received):
            raise FrameError(f"{len(received) - at} excess bytes after the reply")
        if self._unsent:
            self._send_burst()
        elif self._done is not None and not self._done.done():
            self._done.set_result(self._replies)
        return at

    def _fail(self, error: LinkError | FrameError) -> None:
        self._in_flight.clear()
        self._unsent = ()
        if self._done is not None and not self._done.done():
            self._done.set_exception(error)


class SerialLine(asyncio.Transport):
    """asyncio transport of a serial port, opened for exclusive use; passes bytes to a protocol.

    Raises
    ------
    LinkError
        If the port does not exist, or another program has opened it.
    ConfigError
        If the port rejects the settings.
    """

    def __init__(self, settings: SerialTransport, protocol: asyncio.Protocol) -> None:
        super().__init__()
        self._port, self._protocol = _opened(settings), protocol
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(self._port.fileno(), self._receive)
        protocol.connection_made(self)

    def is_closing(self) -> bool:
        """Return whether the port is closed."""
        return not self._port.is_open

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """Write the bytes of requests; close the port if it does not accept them at once."""
        try:
            self._port.write(data)
        except OSError as error:
            self._lose(error)

    def close(self) -> None:
        """Close the port; no effect on a closed port."""
        self._lose(None)

    def _receive(self) -> None:
        try:
            data = self._port.read(_RECEIVE_BYTES)
        except (OSError, TypeError) as error:  # pyserial raises TypeError if the port has vanished
            self._lose(OSError(str(error)))
            return
        if data:
            self._protocol.data_received(data)

    def _lose(self, error: OSError | None) -> None:
        if self._port.is_open:
            self._loop.remove_reader(self._port.fileno())
            self._port.close()
            self._protocol.connection_lost(error)


def _opened(settings: SerialTransport) -> serial.Serial:
    port = serial.Serial()
    port.port, port.baudrate, port.stopbits = settings.device, settings.baudrate, settings.stop_bits
    port.parity, port.exclusive, port.write_timeout = settings.parity[0].upper(), True, 0
    try:
        port.open()
        port.timeout = 0  # configures the port again: only then an ignored setting is reported
    except termios.error as error:  # the port exists but rejects the settings
        port.close()
        kind = ConfigError if error.args[0] == errno.EINVAL else LinkError
        raise kind(f"{settings}: the port rejects the settings: {error.args[-1]}") from None
    except (OSError, EOFError) as error:
        port.close()
        raise LinkError(f"{settings}: {reason_of(error)}") from None
    return port
