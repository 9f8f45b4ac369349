"""`Connection`: the one place where pymodbus' client is touched; one checked request at a time."""

import asyncio
import errno
import os
import termios
from collections.abc import Iterator
from contextlib import contextmanager

from pymodbus.client import AsyncModbusSerialClient, AsyncModbusTcpClient
from pymodbus.exceptions import ConnectionException, ModbusException, ModbusIOException
from pymodbus.pdu import ModbusPDU

from acquisition.delivery.stopping import let_stop_through
from acquisition.errors import AcquisitionError, ConfigError, FrameError, LinkError
from acquisition.modbus.framing import ReadOnlyFramer, Reply, RtuFramer, TcpFramer
from acquisition.modbus.refusals import BUSY, refusal_error
from acquisition.modbus.transport import (
    ConnectionUse,
    LinkSettings,
    SerialTransport,
    TcpTransport,
)

_RECEIVE_LIMIT_BYTES = 1 << 20  # the framer judges every byte; pymodbus' own limit drops silently
_CLOSED = "the device closed the connection"
_MAX_SILENCE_TRIES = 5
_BUSY_WAIT_S = 0.05
"""Before a device that is busy is asked again: some replies, and less than a poll period."""


@contextmanager
def foreign_errors_renamed(where: str) -> Iterator[None]:
    """Let no exception of pymodbus, pyserial, the event loop or the socket through as it is."""
    try:
        yield
    except AcquisitionError:
        raise
    except (ConnectionException, ModbusIOException, OSError, EOFError, termios.error) as exc:
        raise LinkError(f"{where}: {exc or type(exc).__name__}") from exc
    except ModbusException as exc:
        raise FrameError(f"{where}: {exc}") from exc


class Connection:
    """One request at a time, each reply checked against its request.

    After a wrong or a missing reply it is closed, so that a late reply meets nobody. A TCP
    connection is then another one. A serial line stays the same: when it is opened, whatever comes
    is thrown away until nothing has come for as long as a reply may take. Where each request has a
    connection of its own, none is open in between.
    """

    def __init__(self, settings: LinkSettings) -> None:
        self._settings = settings
        self._where = str(settings.transport)
        self._is_kept = settings.connection is ConnectionUse.KEPT
        self._refusal: str | None = None
        self._client, self._framer = _client(settings)
        context = self._client.ctx
        context.trace_connect = self._connection_changed
        context.framer = self._framer
        context.max_buffer_size = _RECEIVE_LIMIT_BYTES
        self._keep_reasons()

    @property
    def where(self) -> str:
        """Host and port, or path of the serial port."""
        return self._where

    async def open(self) -> None:
        """Connect; on a serial line, wait until it is silent.

        Raises
        ------
        LinkError
            If nobody accepts the connection in time, there is no such port, or the line is never
            silent; the message says why.
        ConfigError
            If there can be no such host.
        """
        await self._open()
        if not self._is_kept:
            self.close()

    async def _open(self) -> None:
        self._framer.forget()
        with foreign_errors_renamed(self._where):
            connected = await self._connect()
            let_stop_through()
            if not connected:
                limit = f"no connection within {self._settings.timeout_s} s"
                raise LinkError(f"{self._where}: {self._refusal or limit}")
        if isinstance(self._settings.transport, SerialTransport):
            await self._await_silence()

    def close(self) -> None:
        """Close the connection; again is harmless."""
        self._client.close()

    async def ask(self, request: ModbusPDU, intent: str) -> bytes:
        """Send a request; return the reply from its function code on.

        A device that answers that it is busy is asked again, for as long as a reply may take.

        Parameters
        ----------
        intent
            What is asked for, as a refused request is told; example: "a read of 2 at 100".

        Raises
        ------
        LinkError
            If the device does not answer, or answers that it cannot now.
        FrameError
            If the answer is not one to this request.
        ConfigError
            If the device says that it can never answer.
        """
        n_tries = 1 + int(self._settings.timeout_s / _BUSY_WAIT_S)
        for _ in range(n_tries):
            reply = await self._reply(request)
            if reply.refusal != BUSY:
                break
            await asyncio.sleep(_BUSY_WAIT_S)
        if reply.refusal is not None:
            raise refusal_error(self._where, reply.refusal, intent)
        return reply.pdu

    async def _reply(self, request: ModbusPDU) -> Reply:
        """Send a request once, on a connection of its own if it is to have one."""
        try:
            if not self._is_kept:
                await self._open()
            with foreign_errors_renamed(self._where):
                reply = await self._answer(request)
        except (AcquisitionError, asyncio.CancelledError):
            self.close()
            raise
        if not self._is_kept:
            self.close()
        return reply

    async def _answer(self, request: ModbusPDU) -> Reply:
        match self._settings.transport:
            case SerialTransport(frame_gap_s=frame_gap_s):
                await asyncio.sleep(frame_gap_s)
            case TcpTransport(transactions=transactions):
                self._client.ctx.next_tid = next(transactions) - 1  # it adds one to it
        if not self._client.connected:
            raise LinkError(f"{self._where}: {_CLOSED}")
        if self._framer.unasked:
            raise FrameError(f"{self._where}: {self._framer.unasked}")
        try:
            reply: Reply = await self._client.execute(False, request)
        except RuntimeError as exc:
            transport = self._client.ctx.transport
            if transport is None or transport.is_closing():  # uvloop will not write there
                raise LinkError(f"{self._where}: {_CLOSED}") from exc
            raise
        except ModbusIOException:
            if self._framer.awaiting:
                raise LinkError(f"{self._where}: {self._no_answer()}") from None
            raise
        let_stop_through()
        if reply.fault:
            raise FrameError(f"{self._where}: {reply.fault}")
        return reply

    def _no_answer(self) -> str:
        n_received, limit_s = self._framer.n_received, self._settings.timeout_s
        if n_received:
            return f"{n_received} bytes of an answer, and no more within {limit_s} s"
        return f"no answer within {limit_s} s"

    async def _await_silence(self) -> None:
        """Throw away what still comes, until nothing has come for the time a reply may take."""
        try:
            for _ in range(_MAX_SILENCE_TRIES):
                self._framer.forget()
                await asyncio.sleep(self._settings.timeout_s)
                if not self._client.connected:
                    raise LinkError(f"{self._where}: {_CLOSED}")
                if not self._framer.unasked:
                    return
            wait_s = _MAX_SILENCE_TRIES * self._settings.timeout_s
            raise LinkError(
                f"{self._where}: the line was not silent for {self._settings.timeout_s} s"
                f" within {wait_s:g} s: {self._framer.unasked}"
            )
        except (LinkError, asyncio.CancelledError):
            self.close()
            raise

    async def _connect(self) -> bool:
        """Connect to the first address of the device that answers."""
        transport = self._settings.transport
        if isinstance(transport, SerialTransport):
            return bool(await self._client.connect())
        try:
            transport.host.encode("idna")
        except ValueError as exc:  # a host name that no resolver can even be asked for
            raise ConfigError(f"{self._where}: {exc}") from exc
        for address in await transport.addresses.within(self._settings.timeout_s):
            if address != transport.host:
                self._client.ctx.init_setup_connect_listen(address, transport.port)
                self._keep_reasons()
            if await self._client.connect():
                return True
        return False

    def _keep_reasons(self) -> None:
        context = self._client.ctx
        self._create_connection = context.call_create
        context.call_create = self._create

    async def _create(self) -> object:
        """Connect as pymodbus would, but keep the reason of a refusal, which it only logs."""
        self._refusal = None
        try:
            return await self._create_connection()
        except OSError as exc:
            self._refusal = _reason(exc)
            raise
        except termios.error as exc:  # comes from a port that exists but cannot be set up so
            kind = ConfigError if exc.args[0] == errno.EINVAL else LinkError
            error = kind(f"{self._where}: the port refuses its settings: {exc.args[-1]}")
        raise error  # not in its except: what holds the cause keeps the port open, and locked

    def _connection_changed(self, connected: bool) -> None:
        """Tell the waiting request at once that the link is gone; pymodbus lets it time out."""
        answer = self._client.ctx.response_future
        if not connected and self._framer.awaiting and not answer.done():
            answer.set_exception(LinkError(f"{self._where}: {_CLOSED}"))


def _reason(exc: OSError) -> str:
    """Why no connection could be made, without what event loop and pyserial wrap around it."""
    if exc.errno == errno.EWOULDBLOCK:
        return "another program has the port"
    if exc.errno is not None and exc.errno > 0:
        return os.strerror(exc.errno)
    return exc.strerror or str(exc)


def _client(
    settings: LinkSettings,
) -> tuple[AsyncModbusTcpClient | AsyncModbusSerialClient, ReadOnlyFramer]:
    match settings.transport:
        case TcpTransport(host=host, port=port):
            return AsyncModbusTcpClient(
                host, port=port, timeout=settings.timeout_s, retries=0, reconnect_delay=0
            ), TcpFramer()
        case SerialTransport(device=device, baudrate=baudrate, parity=parity, stop_bits=stop_bits):
            return AsyncModbusSerialClient(
                device,
                baudrate=baudrate,
                parity=parity[0].upper(),
                stopbits=stop_bits,
                timeout=settings.timeout_s,
                retries=0,
                reconnect_delay=0,
            ), RtuFramer()
