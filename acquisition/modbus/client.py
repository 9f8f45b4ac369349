"""The one place where pymodbus' client is touched: a connection that only reads registers."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from pymodbus.client import AsyncModbusTcpClient
from pymodbus.exceptions import ConnectionException, ModbusException, ModbusIOException
from pymodbus.pdu.register_message import ReadHoldingRegistersRequest, ReadInputRegistersRequest

from acquisition.errors import AcquisitionError, ConfigError, FrameError, LinkError
from acquisition.modbus.framing import READ_FUNCTIONS, ReadOnlyFramer, RegisterReply

MAX_REGISTERS_PER_READ = 125
_REQUESTS = {3: ReadHoldingRegistersRequest, 4: ReadInputRegistersRequest}
_RECEIVE_LIMIT_BYTES = 1 << 20  # the framer judges every byte; pymodbus' own limit drops silently
_CLOSED = "the device closed the connection"
_CONFIG_EXCEPTIONS = {1: "illegal function", 2: "illegal address", 3: "illegal value"}
_PASSING_EXCEPTIONS = {
    4: "device failure",
    5: "acknowledge",
    6: "busy",
    10: "gateway path unavailable",
    11: "gateway target does not answer",
}


@dataclass(frozen=True, kw_only=True)
class LinkSettings:
    """How to reach a Modbus TCP device.

    Parameters
    ----------
    device_id
        Unit id, 1 to 255.
    function
        3 (holding registers) or 4 (input registers).
    timeout_s
        For connecting and for each reply, above 0.
    max_registers
        Most registers in one read, 1 to 125.
    """

    host: str
    port: int = 502
    device_id: int = 1
    function: int = 3
    timeout_s: float = 1.0
    max_registers: int = MAX_REGISTERS_PER_READ

    def __post_init__(self) -> None:
        for name, value, lowest, highest in (
            ("port", self.port, 1, 65535),
            ("device_id", self.device_id, 1, 255),
            ("max_registers", self.max_registers, 1, MAX_REGISTERS_PER_READ),
        ):
            if not lowest <= value <= highest:
                raise ConfigError(f"modbus: {name} is {value}, allowed is {lowest} to {highest}")
        if self.function not in READ_FUNCTIONS:
            raise ConfigError(f"modbus: function is {self.function}, allowed are 3 and 4")
        if not 0 < self.timeout_s < float("inf"):
            raise ConfigError(f"modbus: timeout_s is {self.timeout_s}, must be above 0")


@contextmanager
def foreign_errors_renamed(where: str) -> Iterator[None]:
    """Let no exception of pymodbus, the event loop or the socket through under its own name."""
    try:
        yield
    except AcquisitionError:
        raise
    except (ConnectionException, ModbusIOException, OSError, EOFError) as exc:
        raise LinkError(f"{where}: {exc or type(exc).__name__}") from exc
    except ModbusException as exc:
        raise FrameError(f"{where}: {exc}") from exc


def _let_stop_through() -> None:
    """End a task that was told to stop while pymodbus waited.

    Its `asyncio.wait_for` loses the cancellation, before Python 3.12, if the reply arrives at the
    same moment (CPython issue 86296); the task would then go on reading for ever.
    """
    task = asyncio.current_task()
    if task is not None and task.cancelling():
        raise asyncio.CancelledError


class RegisterLink:
    """An open connection: one request at a time, each reply checked against its request.

    After any error the connection is closed, so that a late reply meets nobody.
    """

    def __init__(self, settings: LinkSettings) -> None:
        self._settings = settings
        self._where = f"{settings.host}:{settings.port}"
        self._framer = ReadOnlyFramer()
        self._refusal: str | None = None
        self._client = AsyncModbusTcpClient(
            settings.host,
            port=settings.port,
            timeout=settings.timeout_s,
            retries=0,
            reconnect_delay=0,
            trace_connect=self._connection_changed,
        )
        self._client.ctx.framer = self._framer
        self._client.ctx.max_buffer_size = _RECEIVE_LIMIT_BYTES
        self._create_connection = self._client.ctx.call_create
        self._client.ctx.call_create = self._create

    async def open(self) -> None:
        """Connect.

        Raises
        ------
        LinkError
            If nobody accepts the connection in time; the message says why.
        """
        with foreign_errors_renamed(self._where):
            try:
                connected = await self._client.connect()
            except ValueError as exc:  # a host name that no resolver can even be asked for
                raise ConfigError(f"{self._where}: {exc}") from exc
            _let_stop_through()
            if not connected:
                limit = f"no connection within {self._settings.timeout_s} s"
                raise LinkError(f"{self._where}: {self._refusal or limit}")

    def close(self) -> None:
        """Close the connection; again is harmless."""
        self._client.close()

    async def read(self, address: int, n_registers: int) -> bytes:
        """Read registers in as many requests as it takes.

        Returns
        -------
        bytes
            ``2 * n_registers`` bytes, big-endian words.

        Raises
        ------
        LinkError
            If the device does not answer, or answers that it cannot now.
        FrameError
            If the answer is not one to this request.
        ConfigError
            If the device says that it has no such registers.
        """
        step = self._settings.max_registers
        stop = address + n_registers
        try:
            with foreign_errors_renamed(self._where):
                parts = [
                    await self._read(at, min(step, stop - at)) for at in range(address, stop, step)
                ]
        except (AcquisitionError, asyncio.CancelledError):
            self.close()
            raise
        return b"".join(parts)

    async def _read(self, address: int, count: int) -> bytes:
        if not self._client.connected:
            raise LinkError(f"{self._where}: {_CLOSED}")
        if self._framer.unasked:
            raise FrameError(f"{self._where}: {self._framer.unasked}")
        request = _REQUESTS[self._settings.function](
            dev_id=self._settings.device_id, address=address, count=count
        )
        reply: RegisterReply = await self._client.execute(False, request)
        _let_stop_through()
        if reply.fault:
            raise FrameError(f"{self._where}: {reply.fault}")
        if reply.refusal is not None:
            raise self._device_exception(reply.refusal, address, count)
        return reply.payload

    async def _create(self) -> object:
        """Connect as pymodbus would, but keep the reason of a refusal, which it only logs."""
        try:
            return await self._create_connection()
        except OSError as exc:
            self._refusal = exc.strerror or str(exc)
            raise

    def _connection_changed(self, connected: bool) -> None:
        """Tell the waiting request at once that the link is gone; pymodbus lets it time out."""
        answer = self._client.ctx.response_future
        if not connected and self._framer.awaiting and not answer.done():
            answer.set_exception(ConnectionException(_CLOSED))

    def _device_exception(self, code: int, address: int, count: int) -> AcquisitionError:
        names = _CONFIG_EXCEPTIONS | _PASSING_EXCEPTIONS
        kind = ConfigError if code in _CONFIG_EXCEPTIONS else LinkError
        return kind(
            f"{self._where}: device answers exception {code} ({names.get(code, 'unknown')})"
            f" to a read of {count} registers at {address}"
        )
