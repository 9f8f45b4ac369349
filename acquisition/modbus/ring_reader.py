"""Reading a block ring over an open link: its header and runs of slots."""

from collections.abc import Iterator, Sequence

from acquisition.errors import ConfigError, FrameError
from acquisition.modbus.link import ModbusLink
from acquisition.modbus.profile import HEADER_REGISTERS, RingHeader, decode_header
from acquisition.modbus.ring_layout import RingLayout
from acquisition.modbus.slot import Slot, decode_slot

_N_TRIES = 4
"""A header is short and quickly written; still wrong after this many reads, it is wrong."""


class RingReader:
    """One device's ring, as it is found: slots are not judged here."""

    def __init__(self, link: ModbusLink, base_address: int, function: int) -> None:
        self._link = link
        self._base = base_address
        self._function = function

    @property
    def where(self) -> str:
        """Host and port, or path of the serial port."""
        return self._link.where

    async def header(self) -> RingHeader:
        """Read and decode the header alone.

        Raises
        ------
        ConfigError
            If this is no block ring.
        FrameError
            If its checksum is wrong, however often it is read.
        LinkError
            As the link says.
        """
        n_tries = 0
        while True:
            data = await self._registers(self._base, HEADER_REGISTERS)
            n_tries += 1
            try:
                return decode_header(data)
            except (ConfigError, FrameError) as error:
                if n_tries == _N_TRIES:
                    raise type(error)(f"{self.where}: {error}") from error

    async def slots(self, layout: RingLayout, sequences: Sequence[int]) -> list[Slot]:
        """Read the places where these sequence numbers belong, whatever lies there.

        Returns
        -------
        list
            One slot for each sequence number asked.
        """
        found: list[Slot] = []
        for address, n_slots in _runs(layout, sequences):
            n_registers = (n_slots - 1) * layout.slot_stride + layout.slot_registers
            data = memoryview(await self._registers(address, n_registers))
            found += [
                decode_slot(data[2 * layout.slot_stride * i :], layout) for i in range(n_slots)
            ]
        return found

    async def _registers(self, address: int, n_registers: int) -> bytes:
        return await self._link.read(address, n_registers, self._function)


def _runs(layout: RingLayout, sequences: Sequence[int]) -> Iterator[tuple[int, int]]:
    """Address and number of the slots that lie side by side and without padding."""
    start, n_slots = 0, 0
    for sequence in sequences:
        address = layout.slot_address(sequence)
        if n_slots and address == start + n_slots * layout.slot_stride and _dense(layout):
            n_slots += 1
            continue
        if n_slots:
            yield start, n_slots
        start, n_slots = address, 1
    if n_slots:
        yield start, n_slots


def _dense(layout: RingLayout) -> bool:
    return layout.slot_stride == layout.slot_registers
