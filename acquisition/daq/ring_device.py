"""A simulated device with a block ring: samples in, registers out; no network, no time."""

from dataclasses import dataclass, replace

from acquisition.daq.faults import SlotFault
from acquisition.daq.ledger import Ledger
from acquisition.daq.register_memory import RegisterMemory
from acquisition.modbus.profile import (
    HEADER_REGISTERS,
    U32,
    RingHeader,
    RingLayout,
    Slot,
    encode_header,
    encode_slot,
    encode_slow,
)
from acquisition.raw import RawBlock, RawFeed


@dataclass(frozen=True, kw_only=True)
class RingDeviceSettings:
    """Shape of the ring.

    Parameters
    ----------
    base_address
        Register address of the header.
    samples_per_slot, n_slots
        Ring and header must fit into 65536 registers: 12 channels, 50 samples and 64 slots take
        39,120.
    first_sequence, first_index
        Counters at power-up, 0 to 2**32 - 1; near the end they wrap soon.
    slot_padding
        Unused registers between slots.
    """

    base_address: int = 0
    samples_per_slot: int = 50
    n_slots: int = 64
    first_sequence: int = 0
    first_index: int = 0
    slot_padding: int = 0


class RingDevice:
    """One unit's converter and ring; the first slot is there from the start.

    Parameters
    ----------
    feed
        Where the samples come from; it also says how many channels there are, and their rate.
    unit
        Name under which the ledger books.

    Attributes
    ----------
    memory
        The registers.
    fault
        Applied to every slot before it is written.
    first_sequence
        Where a restart lets the sequence begin.
    frozen
        While set, nothing new is produced: the device answers, its data stand still.

    Raises
    ------
    ConfigError
        If the ring does not fit.
    """

    def __init__(
        self,
        feed: RawFeed,
        unit: str = "U1",
        settings: RingDeviceSettings | None = None,
        ledger: Ledger | None = None,
    ) -> None:
        self._feed = feed
        self._unit = unit
        self._settings = settings or RingDeviceSettings()
        self.ledger = ledger or Ledger()
        self.fault: SlotFault | None = None
        self.frozen = False
        self.first_sequence = self._settings.first_sequence
        self._n_restarts = 0
        first = feed.advance(self._settings.samples_per_slot)
        self.layout = self._layout(first)
        self.layout.require_possible()
        base = self._settings.base_address
        self.memory = RegisterMemory(base, self.layout.end_address - base)
        self._power_up(first)
        self._write(first, None)

    @property
    def newest(self) -> int:
        """Sequence number of the newest slot."""
        return (self._next_sequence - 1) % U32

    def produce(self, n_slots: int = 1, fault: SlotFault | None = None) -> None:
        """Let the converter run for some slots, each passing through the fault."""
        if self.frozen:
            return
        for _ in range(n_slots):
            self._write(self._feed.advance(self._settings.samples_per_slot), fault or self.fault)

    def restart(self, next_epoch: bool = True) -> None:
        """Power off and on: ring empty, counters at their start, next epoch if it tells."""
        first = self._feed.advance(self._settings.samples_per_slot)
        self._n_restarts += next_epoch
        self.memory.clear()
        self._power_up(first)
        self._write(first, None)

    def _power_up(self, first: RawBlock) -> None:
        self.epoch = (first.epoch + self._n_restarts) % U32
        self._next_sequence = self.first_sequence
        self._index_offset = self._settings.first_index - first.first_index

    def _write(self, raw: RawBlock, fault: SlotFault | None) -> None:
        sequence = self._next_sequence
        self._next_sequence = (sequence + 1) % U32
        right = _slot(raw, sequence, (raw.first_index + self._index_offset) % U32)
        slot = fault(right) if fault else right
        if slot is not None:
            self.memory.write(self.layout.slot_address(sequence), encode_slot(slot))
        header = encode_header(RingHeader(self.layout, self.epoch, sequence))
        self.memory.write(self._settings.base_address, header + encode_slow(raw.slow))
        self.ledger.offer(self._unit, self.epoch, self.layout.samples_per_slot)

    def _layout(self, first: RawBlock) -> RingLayout:
        n_channels, n_slow = len(first.counts), len(first.slow)
        samples_per_slot = self._settings.samples_per_slot
        layout = RingLayout(
            n_channels=n_channels,
            samples_per_slot=samples_per_slot,
            n_slots=self._settings.n_slots,
            rate_mhz=round(first.rate_hz * 1000),
            n_slow=n_slow,
            ring_address=self._settings.base_address + HEADER_REGISTERS + 2 * n_slow,
            slot_stride=0,
        )
        return replace(layout, slot_stride=layout.slot_registers + self._settings.slot_padding)


def _slot(raw: RawBlock, sequence: int, first_index: int) -> Slot:
    seconds, microseconds = divmod(raw.start_ns // 1000, 1_000_000)
    return Slot(
        sequence=sequence,
        first_index=first_index,
        seconds=seconds,
        microseconds=microseconds,
        ok_bits=sum(1 << c for c, ok in enumerate(raw.ok) if ok),
        counts=raw.counts,
        trailer=sequence & 0xFFFF,
    )
