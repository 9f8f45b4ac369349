"""`ModbusClient`: what can be read from a Modbus device, over TCP or RTU; nothing can be written.

pymodbus serves the simulated devices; why it does not read real ones is in decision record 31.
"""

import asyncio
from collections.abc import Callable, Sequence
from functools import partial

from acquisition.delivery.network import let_stop_through
from acquisition.errors import AcquisitionError, ConfigError, FrameError, LinkError
from acquisition.modbus.framing import Asked
from acquisition.modbus.identity import Identification, require_identity
from acquisition.modbus.refusals import BUSY, refusal_error
from acquisition.modbus.reply_protocol import CLOSED, ReplyProtocol, SilenceError, reason_of
from acquisition.modbus.requests import (
    EXCEPTION_BIT,
    READ_COILS,
    READ_DISCRETE_INPUTS,
    READ_HOLDING_REGISTERS,
    READ_INPUT_REGISTERS,
    ReadRequest,
    bits_request,
    fifo_registers,
    fifo_request,
    identification_objects,
    identification_request,
    registers_request,
)
from acquisition.modbus.serial_line import open_line
from acquisition.modbus.transport import (
    ADDRESS_SPACE,
    ConnectionUse,
    LinkSettings,
    SerialTransport,
    TcpTransport,
)

_MAX_BITS_PER_READ = 2000
_MAX_IDENTIFICATION_REPLIES = 8
_MAX_SILENCE_TRIES = 5
_BUSY_WAIT_S = 0.05
"""Before a device that is busy is asked again: some replies, and less than a poll period."""


class ModbusClient:
    """One device, and the connection to it.

    The connection is closed after a wrong or a missing reply, so that a late reply is never taken
    for the next one. A serial line stays the same line when it is opened again: all bytes are
    discarded until the line has been silent for `timeout_s`. With `ConnectionUse.PER_REPLY` each
    request opens and closes a connection of its own.
    """

    def __init__(self, settings: LinkSettings) -> None:
        self._settings = settings
        self._protocol = ReplyProtocol(settings.transport)

    @property
    def where(self) -> str:
        """Host and port, or path of the serial port."""
        return str(self._settings.transport)

    @property
    def is_kept(self) -> bool:
        """Whether one connection serves all requests, so that all go to the same device."""
        return self._settings.connection is ConnectionUse.KEPT

    async def open(self) -> None:
        """Connect, on a serial line wait until it is silent, and see whether the device is right.

        Raises
        ------
        LinkError
            If the connection is not accepted in time, the port does not exist, or the line is never
            silent; the message says why.
        ConfigError
            If there can be no such host, or the device is not the expected one.
        FrameError
            If it answers nonsense when it is asked who it is.
        """
        await self._connect()
        if not self.is_kept:
            self.close()
        await self.require_device()

    async def require_device(self) -> None:
        """See whether the device is right, if the settings say how to know it.

        Raises
        ------
        LinkError, FrameError, ConfigError
            As `open`.
        """
        if self._settings.identity is not None:
            await require_identity(self, self._settings.identity)

    def close(self) -> None:
        """Close the connection; again is harmless."""
        self._protocol.close()

    async def read(
        self, address: int, n_registers: int, function: int = READ_HOLDING_REGISTERS
    ) -> bytes:
        """Read registers in as many requests as it takes.

        Parameters
        ----------
        function
            3 (holding registers) or 4 (input registers).

        Returns
        -------
        bytes
            ``2 * n_registers`` bytes, big-endian words.

        Raises
        ------
        LinkError
            If the device does not answer, or answers that it cannot now.
        FrameError
            If an answer is not the one to its request.
        ConfigError
            If the device says that it has no such registers, or there can be none.
        """
        make = partial(registers_request, function=function)
        functions = (READ_HOLDING_REGISTERS, READ_INPUT_REGISTERS)
        step = self._settings.max_registers
        return await self._read(make, functions, address, n_registers, function, step)

    async def read_each(
        self, addresses: Sequence[int], function: int = READ_HOLDING_REGISTERS
    ) -> bytes:
        """Read single registers, each with a request of its own.

        Raises
        ------
        LinkError, FrameError, ConfigError
            As `read`.
        """
        requests = [registers_request(address, 1, function) for address in addresses]
        return b"".join([pdu[2:] for pdu in await self._ask(requests)])

    async def read_bits(
        self, address: int, n_bits: int, function: int = READ_DISCRETE_INPUTS
    ) -> bytes:
        """Read coils (function 1) or discrete inputs (2).

        Returns
        -------
        bytes
            Eight bits a byte, the first one lowest; bits past the last one mean nothing.

        Raises
        ------
        LinkError, FrameError, ConfigError
            As `read`.
        """
        make = partial(bits_request, function=function)
        functions = (READ_COILS, READ_DISCRETE_INPUTS)
        return await self._read(make, functions, address, n_bits, function, _MAX_BITS_PER_READ)

    async def read_fifo(self, address: int) -> bytes:
        """Read a queue of 0 to 31 registers, big-endian words.

        Raises
        ------
        LinkError, FrameError, ConfigError
            As `read`; a FrameError too if the device claims more than 31.
        """
        self._require_in_space(address, 1)
        [pdu] = await self._ask([fifo_request(address)])
        return fifo_registers(pdu)

    async def identify(self) -> Identification:
        """Read vendor, product code and revision, by function 43/14.

        Raises
        ------
        LinkError, FrameError, ConfigError
            As `read`; ConfigError too if the device has no such function.
        """
        objects: dict[int, bytes] = {}
        following: int | None = 0
        for _ in range(_MAX_IDENTIFICATION_REPLIES):
            [pdu] = await self._ask([identification_request(following or 0)])
            found, following = identification_objects(pdu)
            objects |= found
            if following is None:
                return Identification.of_objects(objects)
        self.close()
        raise FrameError(f"{self.where}: the identification has no end")

    async def _read(
        self,
        make: Callable[[int, int], ReadRequest],
        functions: Sequence[int],
        address: int,
        n_wanted: int,
        function: int,
        step: int,
    ) -> bytes:
        self._require_in_space(address, n_wanted)
        if function not in functions:
            raise ConfigError(f"modbus: function is {function}, allowed are {sorted(functions)}")
        stop = address + n_wanted
        requests = [make(at, min(step, stop - at)) for at in range(address, stop, step)]
        return b"".join([pdu[2:] for pdu in await self._ask(requests)])

    async def _ask(self, requests: Sequence[ReadRequest]) -> list[bytes]:
        """Replies to requests, from their function codes on, some requests in flight at a time."""
        replies: list[bytes] = []
        while len(replies) < len(requests):
            stop = len(replies) + self._settings.in_flight.now
            burst = requests[len(replies) : stop]
            found = await self._exchange(burst)
            for request, pdu in zip(burst, found, strict=True):
                if pdu[0] & EXCEPTION_BIT:
                    pdu = await self._asked_again(request, pdu[1])
                replies.append(pdu)
        return replies

    async def _asked_again(self, request: ReadRequest, refusal: int) -> bytes:
        """Ask a device that is busy again, for as long as a reply may take."""
        for _ in range(int(self._settings.timeout_s / _BUSY_WAIT_S)):
            if refusal != BUSY:
                break
            await asyncio.sleep(_BUSY_WAIT_S)
            [pdu] = await self._exchange([request])
            if not pdu[0] & EXCEPTION_BIT:
                return pdu
            refusal = pdu[1]
        raise refusal_error(self.where, refusal, request.intent)

    async def _exchange(self, burst: Sequence[ReadRequest]) -> list[bytes]:
        """Send requests once, on a connection of its own if each is to have one."""
        in_flight, is_burst = self._settings.in_flight, len(burst) > 1
        try:
            if not self.is_kept:
                await self._connect()
            replies = await self._sent(burst)
        except (SilenceError, FrameError) as error:
            self.close()
            if is_burst:
                in_flight.stalled()
                words = f"{error}, {len(burst)} requests in flight; one at a time from now on"
                raise type(error)(words) from error
            raise
        except (AcquisitionError, asyncio.CancelledError) as error:
            self.close()
            if is_burst and isinstance(error, LinkError):
                in_flight.cut()
            raise
        in_flight.answered()
        if not self.is_kept:
            self.close()
        return replies

    async def _sent(self, burst: Sequence[ReadRequest]) -> list[bytes]:
        unit, transport = self._settings.device_id, self._settings.transport
        match transport:
            case SerialTransport(frame_gap_s=frame_gap_s):
                await asyncio.sleep(frame_gap_s)
                asked = [Asked(request, unit) for request in burst]
            case TcpTransport(transactions=transactions):
                asked = [Asked(request, unit, next(transactions)) for request in burst]
        return await self._protocol.ask(asked, self._settings.timeout_s)

    async def _connect(self) -> None:
        self._protocol.close()
        transport = self._settings.transport
        if isinstance(transport, SerialTransport):
            self._protocol = ReplyProtocol(transport)
            open_line(transport, self._protocol)
            await self._await_silence()
        else:
            await self._connect_to(transport)

    async def _connect_to(self, transport: TcpTransport) -> None:
        """Connect to the first address of the device that answers."""
        try:
            transport.host.encode("idna")
        except ValueError as error:  # a host name that no resolver can even be asked for
            raise ConfigError(f"{self.where}: {error}") from error
        timeout_s = self._settings.timeout_s
        why = f"no connection within {timeout_s} s"
        try:
            for address in await transport.addresses.within(timeout_s):
                try:
                    async with asyncio.timeout(timeout_s):
                        await self._connect_at(address, transport)
                except TimeoutError:
                    continue
                except OSError as error:
                    why = reason_of(error)
                else:
                    return
                finally:
                    let_stop_through()
        except OSError as error:
            why = str(error)
        raise LinkError(f"{self.where}: {why}")

    async def _connect_at(self, address: str, transport: TcpTransport) -> None:
        loop = asyncio.get_running_loop()
        protocol = ReplyProtocol(transport)
        await loop.create_connection(lambda: protocol, address, transport.port)
        self._protocol = protocol

    async def _await_silence(self) -> None:
        """Throw away what still comes, until nothing has come for the time a reply may take."""
        protocol, timeout_s = self._protocol, self._settings.timeout_s
        try:
            for _ in range(_MAX_SILENCE_TRIES):
                protocol.unasked = ""
                await asyncio.sleep(timeout_s)
                if not protocol.is_open:
                    raise LinkError(f"{self.where}: {CLOSED}")
                if not protocol.unasked:
                    return
            raise LinkError(
                f"{self.where}: the line was not silent for {timeout_s} s"
                f" within {_MAX_SILENCE_TRIES * timeout_s:g} s: {protocol.unasked}"
            )
        except (LinkError, asyncio.CancelledError):
            self.close()
            raise

    def _require_in_space(self, address: int, n_wanted: int) -> None:
        if not 0 <= address < address + n_wanted <= ADDRESS_SPACE:
            raise ConfigError(
                f"{self.where}: {n_wanted} at {address} are asked, addresses are 0 to"
                f" {ADDRESS_SPACE - 1}"
            )
