"""`ModbusLink`: what can be read from a Modbus device, over TCP or RTU; nothing can be written."""

from collections.abc import Mapping

from pymodbus.pdu import ModbusPDU
from pymodbus.pdu.bit_message import ReadCoilsRequest, ReadDiscreteInputsRequest
from pymodbus.pdu.file_message import ReadFifoQueueRequest
from pymodbus.pdu.mei_message import ReadDeviceInformationRequest
from pymodbus.pdu.register_message import ReadHoldingRegistersRequest, ReadInputRegistersRequest

from acquisition.errors import ConfigError, FrameError
from acquisition.modbus.connection import Connection
from acquisition.modbus.identity import Identification, require_identity
from acquisition.modbus.requests import (
    READ_COILS,
    READ_DISCRETE_INPUTS,
    READ_HOLDING_REGISTERS,
    READ_INPUT_REGISTERS,
    fifo_registers,
    identification_objects,
)
from acquisition.modbus.transport import ADDRESS_SPACE, ConnectionUse, LinkSettings

_MAX_BITS_PER_READ = 2000
_REGISTER_REQUESTS = {
    READ_HOLDING_REGISTERS: ReadHoldingRegistersRequest,
    READ_INPUT_REGISTERS: ReadInputRegistersRequest,
}
_BIT_REQUESTS = {
    READ_COILS: ReadCoilsRequest,
    READ_DISCRETE_INPUTS: ReadDiscreteInputsRequest,
}
_MAX_IDENTIFICATION_REPLIES = 8


class ModbusLink:
    """An open link to one device."""

    def __init__(self, settings: LinkSettings) -> None:
        self._settings = settings
        self._connection = Connection(settings)

    @property
    def where(self) -> str:
        """Host and port, or path of the serial port."""
        return str(self._settings.transport)

    async def open(self) -> None:
        """Connect, on a serial line wait until it is silent, and see whether the device is right.

        Raises
        ------
        LinkError, ConfigError
            As `Connection.open`; a ConfigError too if the device is not the expected one.
        FrameError
            If it answers nonsense when it is asked who it is.
        """
        await self._connection.open()
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

    @property
    def is_kept(self) -> bool:
        """Whether one connection serves all requests, so that all go to the same device."""
        return self._settings.connection is ConnectionUse.KEPT

    def close(self) -> None:
        """Close the connection; again is harmless."""
        self._connection.close()

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
            If the answer is not one to this request.
        ConfigError
            If the device says that it has no such registers, or there can be none.
        """
        step = self._settings.max_registers
        return await self._read(_REGISTER_REQUESTS, address, n_registers, function, step)

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
        return await self._read(_BIT_REQUESTS, address, n_bits, function, _MAX_BITS_PER_READ)

    async def read_fifo(self, address: int) -> bytes:
        """Read a queue of 0 to 31 registers, big-endian words.

        Raises
        ------
        LinkError, FrameError, ConfigError
            As `read`; a FrameError too if the device claims more than 31.
        """
        _require_in_space(self.where, address, 1)
        request = ReadFifoQueueRequest(address=address, dev_id=self._settings.device_id)
        return fifo_registers(
            await self._connection.ask(request, f"a read of the queue at {address}")
        )

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
            request = ReadDeviceInformationRequest(
                object_id=following or 0, dev_id=self._settings.device_id
            )
            pdu = await self._connection.ask(request, "a read of its identification")
            found, following = identification_objects(pdu)
            objects |= found
            if following is None:
                return Identification.of_objects(objects)
        self.close()
        raise FrameError(f"{self.where}: the identification has no end")

    async def _read(
        self,
        requests: Mapping[int, type[ModbusPDU]],
        address: int,
        n_wanted: int,
        function: int,
        step: int,
    ) -> bytes:
        _require_in_space(self.where, address, n_wanted)
        if function not in requests:
            raise ConfigError(f"modbus: function is {function}, allowed are {sorted(requests)}")
        parts = []
        for at in range(address, address + n_wanted, step):
            count = min(step, address + n_wanted - at)
            request = requests[function](dev_id=self._settings.device_id, address=at, count=count)
            pdu = await self._connection.ask(
                request, f"a read of {count} at {at}, function {function}"
            )
            parts.append(pdu[2:])
        return b"".join(parts)


def _require_in_space(where: str, address: int, n_wanted: int) -> None:
    if not 0 <= address < address + n_wanted <= ADDRESS_SPACE:
        raise ConfigError(
            f"{where}: {n_wanted} at {address} are asked, addresses are 0 to {ADDRESS_SPACE - 1}"
        )
