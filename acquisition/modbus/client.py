"""`ModbusClient`: read-only client of a Modbus device over TCP or RTU.

pymodbus is used for the simulated devices only; decision record 31 states the reasons.
"""

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from itertools import chain, repeat

from acquisition.delivery.network import HostAddresses
from acquisition.errors import ConfigError, FrameError, LinkError
from acquisition.modbus.connection import (
    CLOSED,
    ReplyProtocol,
    SerialLine,
    SilenceError,
    reason_of,
)
from acquisition.modbus.framing import PendingRequest
from acquisition.modbus.requests import (
    BUSY,
    EXCEPTION_BIT,
    FIFO_HEAD,
    READ_HOLDING_REGISTERS,
    ReadRequest,
    Span,
    exception_error,
    fifo_request,
    identification_objects,
    identification_request,
    span_requests,
)
from acquisition.modbus.transport import (
    Identification,
    Identity,
    LinkSettings,
    SerialTransport,
    TcpTransport,
)

_N_TRANSACTIONS = 65_000
"""Largest transaction id; id 0 is not used, because some devices treat it as a wildcard."""

_MAX_IDENTIFICATION_REPLIES = 8
_N_IDENTITY_TRIES = 2
"""Identity reads before a mismatch is an error; one reply may be corrupted in transmission."""

_MAX_SILENCE_TRIES = 5
_MAX_INTERRUPTED = 2
_BUSY_WAIT_S = 0.05
"""Delay before a request to a busy device is repeated; shorter than a poll period."""


class ModbusClient:
    """Client of one Modbus device, with one connection at a time; it can be reopened after closing.

    The connection is closed after a wrong or missing reply, so that a late reply is never mistaken
    for the reply to the next request. Transaction ids continue across connections, because a
    gateway may forward a late reply to the next connection. When a serial line is reopened, all
    received bytes are discarded until the line has been silent for `timeout_s`. If connections
    are not kept, each request opens and closes its own connection.

    All methods that read raise LinkError if the device does not answer, reports a temporary
    failure, or sends a reply that does not match its request, and ConfigError if the device reports
    an illegal function, address or value.

    Attributes
    ----------
    requests_in_flight
        Maximum number of requests sent before the first reply: the configured number, reduced to 1
        after several requests in flight had a wrong reply, or were interrupted twice in succession
        because the device closed the connection or did not reply. A device that has never replied
        to several requests in flight is given no second try after a missing reply.
    """

    def __init__(self, settings: LinkSettings) -> None:
        self._settings = settings
        self._protocol = ReplyProtocol(settings.transport)
        self._addresses: HostAddresses | None = None
        self._transactions = chain.from_iterable(repeat(range(1, _N_TRANSACTIONS + 1)))
        self._n_interrupted = 0
        self._has_answered_several = False
        self.requests_in_flight = settings.requests_in_flight

    @property
    def where(self) -> str:
        """Address of the device in error messages: host and port, or path of the serial port."""
        return str(self._settings.transport)

    @property
    def is_kept(self) -> bool:
        """Whether one connection is used for all requests, so that all reach the same device."""
        return self._settings.keeps_connection

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        """Open the connection, with the errors of `open`; close it on exit of the context."""
        try:
            await self.open()
            yield
        finally:
            self.close()

    async def open(self) -> None:
        """Connect and check the device's identity; on a serial line, first wait for silence.

        Raises
        ------
        LinkError
            If the connection is not accepted in time, the port does not exist, the line is never
            silent, or the device does not report its identity; the message states the cause.
        ConfigError
            If the host name is invalid, or the device's identity is not the configured one.
        """
        await self._connect()
        if not self.is_kept:
            self.close()
        await self.require_device()

    async def require_device(self) -> None:
        """Check that the device has the configured identity; no effect if none is configured.

        If it differs, raises ConfigError with the found and the expected identity.
        """
        identity = self._settings.identity
        if identity is None:
            return
        for _ in range(_N_IDENTITY_TRIES):
            misfit = await self._misfit(identity)
            if misfit is None:
                return
        raise ConfigError(f"{self.where}: wrong device: {misfit}")

    def close(self) -> None:
        """Close the connection; no effect on a closed connection."""
        self._protocol.close()

    async def read(self, address: int, count: int, function: int = READ_HOLDING_REGISTERS) -> bytes:
        """Read `count` registers (as big-endian words) or packed bits, from an address on.

        The first of eight bits in a byte is the least significant. Raises ConfigError if function
        or address range are invalid.
        """
        return await self.read_spans([Span(address, count, function)])

    async def read_spans(self, spans: Sequence[Span]) -> bytes:
        """Read ranges of registers or bits; a long range takes several requests.

        Returns
        -------
        bytes
            Concatenated contents of the ranges: registers as big-endian words, bits packed eight to
            a byte, the first bit least significant.
        """
        requests = [request for span in spans for request in span_requests(span)]
        return b"".join([reply[2:] for reply in await self._replies(requests)])

    async def read_fifos(self, addresses: Sequence[int]) -> list[bytes]:
        """Read one FIFO queue per address; return its 0 to 31 registers as big-endian words.

        Raises LinkError if the device states more than 31 registers.
        """
        replies = await self._replies([fifo_request(address) for address in addresses])
        return [reply[FIFO_HEAD.size :] for reply in replies]

    async def identify(self) -> Identification:
        """Read vendor, product code and revision by function 43/14.

        Raises LinkError if the identification takes more than eight replies.
        """
        objects: dict[int, bytes] = {}
        following: int | None = 0
        for _ in range(_MAX_IDENTIFICATION_REPLIES):
            [reply] = await self._replies([identification_request(following or 0)])
            found, following = identification_objects(reply)
            objects |= found
            if following is None:
                return Identification.of_objects(objects)
        self.close()
        raise LinkError(
            f"{self.where}: identification takes more than {_MAX_IDENTIFICATION_REPLIES} replies"
        )

    async def _misfit(self, identity: Identity) -> str | None:
        if isinstance(identity, Identification):
            return identity.misfit(await self.identify())
        found = await self.read(identity.address, len(identity.words), identity.function)
        return identity.misfit(found)

    async def _replies(self, requests: Sequence[ReadRequest]) -> list[bytes]:
        """Return the PDUs of the replies to requests; repeat requests to a busy device."""
        is_line = isinstance(self._settings.transport, SerialTransport)
        n_at_once = len(requests) if self.is_kept and not is_line else 1
        replies: list[bytes] = []
        while len(replies) < len(requests):
            asked = requests[len(replies) : len(replies) + n_at_once]
            found = await self._exchange(asked)
            for n, reply in enumerate(found):
                if reply[0] & EXCEPTION_BIT:
                    found[n] = await self._retry_busy(asked[n], reply)
            replies += found
        return replies

    async def _retry_busy(self, request: ReadRequest, reply: bytes) -> bytes:
        """Repeat a request while the device is busy, for at most `timeout_s`; return the reply."""
        for _ in range(int(self._settings.timeout_s / _BUSY_WAIT_S)):
            if reply[1] != BUSY:
                break
            await asyncio.sleep(_BUSY_WAIT_S)
            [reply] = await self._exchange([request])
            if not reply[0] & EXCEPTION_BIT:
                return reply
        raise exception_error(self.where, reply[1], request)

    async def _exchange(self, requests: Sequence[ReadRequest]) -> list[bytes]:
        """Send requests once and return the replies; first connect if connections are not kept."""
        unit, transport = self._settings.device_id, self._settings.transport
        try:
            if not self.is_kept:
                await self._connect()
            if isinstance(transport, SerialTransport):
                await asyncio.sleep(transport.frame_gap_s)
            replies = await self._protocol.exchange(
                list(map(PendingRequest, requests, repeat(unit), self._transactions)),
                self.requests_in_flight,
                self._settings.timeout_s,
            )
        except (ConfigError, asyncio.CancelledError):
            self.close()
            raise
        except (LinkError, FrameError) as error:
            self.close()
            words = str(error)
            if isinstance(error, FrameError):
                words = f"closed the connection after a malformed reply: {error}"
            n_in_flight = self._protocol.n_in_flight
            if n_in_flight > 1 and self._shows_too_many(error):
                self.requests_in_flight = 1
                words += f"; {n_in_flight} requests were in flight, from now on one at a time"
            raise LinkError(words) from error
        if min(len(requests), self.requests_in_flight) > 1:
            self._n_interrupted, self._has_answered_several = 0, True
        if not self.is_kept:
            self.close()
        return replies

    def _shows_too_many(self, error: LinkError | FrameError) -> bool:
        """Return whether an error shows that a device cannot handle several requests in flight."""
        if isinstance(error, FrameError):
            return True
        self._n_interrupted += 1
        is_new = isinstance(error, SilenceError) and not self._has_answered_several
        return is_new or self._n_interrupted >= _MAX_INTERRUPTED

    async def _connect(self) -> None:
        self._protocol.close()
        transport = self._settings.transport
        if isinstance(transport, SerialTransport):
            self._protocol = ReplyProtocol(transport)
            SerialLine(transport, self._protocol)
            await self._await_silence()
        else:
            await self._connect_to(transport)

    async def _connect_to(self, transport: TcpTransport) -> None:
        """Connect to the first of the host's IP addresses that accepts the connection."""
        try:
            transport.host.encode("idna")
        except ValueError as error:  # a host name that no resolver accepts
            raise ConfigError(f"{self.where}: {error}") from error
        if self._addresses is None:
            self._addresses = HostAddresses(transport.host, transport.port)
        loop, timeout_s = asyncio.get_running_loop(), self._settings.timeout_s
        why = f"no connection within {timeout_s} s"
        try:
            for address in await self._addresses.within(timeout_s):
                try:
                    async with asyncio.timeout(timeout_s):
                        _, self._protocol = await loop.create_connection(
                            lambda: ReplyProtocol(transport), address, transport.port
                        )
                except TimeoutError:
                    continue
                except OSError as error:
                    why = reason_of(error)
                else:
                    return
        except OSError as error:
            why = str(error)
        raise LinkError(f"{self.where}: {why}")

    async def _await_silence(self) -> None:
        """Discard received bytes until the line has been silent for `timeout_s`."""
        protocol, timeout_s = self._protocol, self._settings.timeout_s
        try:
            for _ in range(_MAX_SILENCE_TRIES):
                protocol.unsolicited = ""
                await asyncio.sleep(timeout_s)
                if not protocol.is_open:
                    raise LinkError(f"{self.where}: {CLOSED}")
                if not protocol.unsolicited:
                    return
            raise LinkError(
                f"{self.where}: the serial line was not silent for {timeout_s:g} s"
                f" within {_MAX_SILENCE_TRIES * timeout_s:g} s; received without a request:"
                f" {protocol.unsolicited}; disconnect any other master"
            )
        except (LinkError, asyncio.CancelledError):
            self.close()
            raise
