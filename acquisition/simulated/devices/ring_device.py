"""Simulated Modbus device with a block ring: writes the samples of a feed to registers."""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from acquisition.errors import ConfigError
from acquisition.modbus.ring_profile import HEADER_REGISTERS, U32, RingHeader, RingLayout, Slot
from acquisition.simulated.devices.modbus_device import ModbusDevice, RegisterMemory
from acquisition.simulated.devices.register_image import encode_header, encode_slot, encode_slow
from acquisition.simulated.devices.ring_faults import SLOT_FAULTS, ReadingWatch, SlotFault
from acquisition.simulated.feed import Ledger, SampleFeed
from core.samples.blocks import SampleBlock


@dataclass(frozen=True, kw_only=True)
class RingDeviceSettings:
    """Layout and start values of a simulated block ring.

    Parameters
    ----------
    base_address
        Register address of the header.
    samples_per_slot, n_slots
        Size of the ring, which must fit into 65536 registers with its header: 12 channels, 50
        samples, 10 slow values and 64 slots need 40,612 registers.
    first_sequence
        Sequence number at power-up, 0 to 2**32 - 1, after which it wraps.
    first_index
        Sample index at power-up, 0 to 2**32 - 1; None for the sample index of the feed.
    slot_padding
        Unused registers between slots.
    """

    base_address: int = 0
    samples_per_slot: int = 50
    n_slots: int = 64
    first_sequence: int = 0
    first_index: int | None = None
    slot_padding: int = 0


class RingDevice(ModbusDevice):
    """Simulated Modbus device with a block ring; the first slot is available from the start.

    Slots begin at multiples of their length in the sample index of the feed. In a gap of the feed
    the device writes no slots; after the gap, sequence number, sample index and time continue
    consistently. A new epoch of the feed restarts the device. `ledger` counts the produced samples,
    by default in a new `Ledger`, for the unit named `unit`.

    Parameters
    ----------
    feed
        Source of the samples; defines the number of channels and the sampling rate.
    settings
        Layout and start values; None for the default `RingDeviceSettings`.

    Attributes
    ----------
    memory
        Registers of header and ring.
    layout
        Register layout of header and ring.
    first_sequence
        Sequence number after a restart.
    epoch
        Current epoch, as in the header.
    patient
        Whether the device waits for its client before it overwrites an unread slot or restarts.

    Raises
    ------
    ConfigError
        If the ring does not fit, or the feed has no complete slot of int16 counts.
    """

    def __init__(
        self,
        feed: SampleFeed,
        unit: str = "U1",
        settings: RingDeviceSettings | None = None,
        ledger: Ledger | None = None,
    ) -> None:
        self._settings = settings = settings or RingDeviceSettings()
        super().__init__(feed, settings.samples_per_slot, unit, ledger)
        self.patient = False
        self.first_sequence = settings.first_sequence
        self._waiting_faults: deque[SlotFault] = deque()
        self._fault: SlotFault | None = None
        self._before: Slot | None = None
        self._n_restarts = self._newest = 0
        first = self._feed.take()
        if first is None:
            n_whole = settings.samples_per_slot
            raise ConfigError(f"block ring: feed has no slot of {n_whole} samples without a gap")
        self.layout = _layout(first, settings)
        self._watch = ReadingWatch(self.layout)
        base = settings.base_address
        self.memory = RegisterMemory(base, self.layout.end_address - base)
        self._power_up(first, settings.first_index)

    @property
    def newest(self) -> int:
        """Sequence number of the newest slot."""
        return self._newest

    @property
    def step_s(self) -> float:
        """Duration of one slot in seconds."""
        return self.layout.slot_duration_s

    @property
    def faults(self) -> Mapping[str, Callable[[int], None]]:
        """Fault injectors by name, called with a count: faulty slots, frozen data, restarts."""
        slot_faults = {**SLOT_FAULTS, "repeat": self._repeated}
        return {
            **super().faults,
            **{name: partial(self._spoil_slots, fault) for name, fault in slot_faults.items()},
            "reset_epoch": self._reset,
        }

    def produce(self, n_steps: int = 1, fault: SlotFault | None = None) -> None:
        """Advance the time by `n_steps` slots and write them, each with `fault` applied, if any."""
        self._fault = fault
        super().produce(n_steps)
        self._fault = None

    def produce_unpaced(self, n_slots: int) -> None:
        """Write the next slots without delay, also after a gap, without overwriting a new slot.

        At most `n_slots` places of the ring are used by slots and gaps; a gap before the first slot
        does not count.
        """
        if self._n_frozen:
            self._n_frozen -= 1
            return
        limit = self._position + n_slots
        for n_taken in range(0 if self.frozen else n_slots):
            ahead = self._feed.peek()
            if ahead is None:
                self.ended = True
                return
            restarts = ahead.epoch != self._feed_epoch
            if n_taken and (restarts or self._feed.number(ahead) > limit):
                return
            self._take()
            if not n_taken:
                limit = self._position + n_slots - 1

    def restart(self, next_epoch: bool = True) -> None:
        """Restart the device, by default in the next epoch: clear the ring, reset the counters.

        If the feed has ended, the ring is kept and `ended` is set.
        """
        first = self._feed.take()
        if first is None:
            self.ended = True
            return
        self._n_restarts += next_epoch
        self._power_up(first, self._settings.first_index or 0)

    def read_registers(self, function: int, address: int, count: int) -> bytes | None:  # noqa: ARG002
        """Return `count` registers as big-endian words; None if an address does not exist."""
        asked = range(address, address + count)
        if self._settings.base_address in asked:
            self._look()
        data = self.memory.read(address, count)
        self._watch.note_read(asked)
        return data

    def _look(self) -> None:
        """Record a read of the header; produce slots if on demand and all slots are read."""
        self._watch.note_look()
        if not self._watch.waiting:
            return
        if self.on_demand and not self.ended:
            self.produce_unpaced(max(1, (self.layout.n_slots - 2) // 2))
        self._n_looks += self.ended

    def _must_wait(self, ahead: SampleBlock) -> bool:
        """Whether a patient device must wait until its client has read previous slots."""
        if not self.patient:
            return False
        if not self._watch.anything_read:
            return True
        if ahead.epoch != self._feed_epoch:
            return self._watch.n_unread > 0
        n_ahead = self._feed.number(ahead) - self._number
        return self._watch.n_unread > max(0, self.layout.n_slots - 2 - n_ahead)

    def _show(self, raw: SampleBlock) -> None:
        if raw.epoch != self._feed_epoch:
            self._power_up(raw, self._settings.first_index)
            return
        n_slots = self._feed.number(raw) - self._number
        self._newest = (self._newest + n_slots) % U32
        faults = [self._waiting_faults.popleft()] if self._waiting_faults else []
        self._write(raw, n_slots, [*faults, self._fault] if self._fault else faults)

    def _power_up(self, first: SampleBlock, first_index: int | None) -> None:
        self.memory.clear()
        self._watch.clear()
        self._feed_epoch = first.epoch
        self.epoch = (first.epoch + self._n_restarts) % U32
        self._newest = self.first_sequence
        self._index_offset = 0 if first_index is None else first_index - first.first_index
        self._write(first, 1, [])

    def _write(self, raw: SampleBlock, n_slots: int, faults: list[SlotFault]) -> None:
        """Write a slot and the header; the slot is `n_slots` places after the previous slot."""
        self._number = self._position = self._feed.number(raw)
        self._watch.note_written(self._newest)
        self._n_looks = 0
        right = self._slot(raw)
        slot: Slot | None = right
        for fault in faults:
            slot = slot and fault(slot)
        self._before = right
        if slot is not None:
            address = self.layout.slot_address(self._newest)
            self.memory.write(address, encode_slot(slot))
        header = encode_header(RingHeader(self.layout, self.epoch, self._newest))
        self.memory.write(
            self._settings.base_address, header + encode_slow(raw.side.slow[:, 0].tolist())
        )
        self.ledger.offer(self._unit, self.epoch, n_slots * self.layout.samples_per_slot)

    def _slot(self, raw: SampleBlock) -> Slot:
        seconds, microseconds = divmod(raw.start_ns // 1000, 1_000_000)
        return Slot(
            sequence=self._newest,
            first_index=(raw.first_index + self._index_offset) % U32,
            seconds=seconds,
            microseconds=microseconds,
            ok_bits=sum(1 << c for c, ok in enumerate(raw.side.ok[:, 0]) if ok),
            counts=raw.counts.astype(np.int16, copy=False),
            trailer=self._newest & 0xFFFF,
            epoch=self.epoch,
            slow=tuple(raw.side.slow[:, 0].tolist()),
        )

    def _repeated(self, slot: Slot) -> Slot:
        """Return the previous slot with the new sequence number, as a slot fault."""
        before = self._before or slot
        return replace(before, sequence=slot.sequence, trailer=slot.trailer)

    def _spoil_slots(self, fault: SlotFault, count: int) -> None:
        self._waiting_faults.extend([fault] * count)

    def _reset(self, count: int) -> None:
        for _ in range(count):
            self.restart()


def _layout(first: SampleBlock, settings: RingDeviceSettings) -> RingLayout:
    """Return the layout of a ring for the channels of the first slot.

    Raises `ConfigError` if the slot has no int16 counts or the ring does not fit.
    """
    if first.counts.dtype != np.int16:
        raise ConfigError(f"block ring: samples must be int16 counts, got {first.counts.dtype}")
    n_slow = len(first.side.slow)
    layout = RingLayout(
        n_channels=len(first.counts),
        samples_per_slot=settings.samples_per_slot,
        n_slots=settings.n_slots,
        rate_mhz=round(first.rate_hz * 1000),
        n_slow=n_slow,
        ring_address=settings.base_address + HEADER_REGISTERS + 2 * n_slow,
        slot_stride=0,
    )
    layout = replace(layout, slot_stride=layout.slot_registers + settings.slot_padding)
    layout.require_possible()
    return layout
