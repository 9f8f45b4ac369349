"""A simulated device with a block ring: samples in, registers out; no network, no time."""

from collections import deque
from collections.abc import Mapping

import numpy as np

from acquisition.delivery.raw import RawBlock
from acquisition.errors import ConfigError
from acquisition.modbus.ring_profile import (
    U32,
    RingHeader,
    Slot,
    encode_header,
    encode_slot,
    encode_slow,
)
from acquisition.simulated.devices import faults
from acquisition.simulated.devices.faults import Repetition, SlotFault
from acquisition.simulated.devices.reading_watch import ReadingWatch
from acquisition.simulated.devices.register_memory import RegisterMemory
from acquisition.simulated.devices.ring_shape import RingDeviceSettings, layout_of
from acquisition.simulated.feed import Ledger, RawFeed, SlotFeed

_LAST_LOOKS = 2
"""A reader that looks a second time has got the answer to the first, and all that it asked for."""

_SLOT_FAULTS: Mapping[str, SlotFault] = {
    "drop": faults.dropped,
    "tear": faults.torn,
    "damage": faults.damaged,
    "wrong_sequence": faults.wrong_sequence,
    "wrong_index": faults.wrong_index,
    "wrong_time": faults.wrong_time,
}


class RingDevice:
    """One unit's converter and ring; the first slot is there from the start.

    Slots lie on the feed's grid of sample numbers. Where the feed has a gap, slot times pass
    without a slot, and sequence, index and time go on together behind it. Where the feed begins a
    new epoch the device begins anew. When the feed has ended the device stands still.

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
    layout
        Where everything lies in them.
    fault
        Applied to every slot before it is written.
    faults
        Applied to one slot each, before `fault`, until there are no more.
    first_sequence
        Where a restart lets the sequence begin.
    frozen
        While set, nothing new is produced: the device answers, its data stand still.
    epoch
        As the device tells it.
    ended
        Whether the feed has nothing more.
    on_demand
        Whether the device produces when its reader has read everything and looks for more.
    patient
        Whether it waits for its reader before it overwrites a slot that was not read, or begins
        anew.
    identification
        Answer to function 43/14, by object number; none without it.

    Raises
    ------
    ConfigError
        If the ring does not fit, or the feed has not one slot of counts.
    """

    def __init__(
        self,
        feed: RawFeed,
        unit: str = "U1",
        settings: RingDeviceSettings | None = None,
        ledger: Ledger | None = None,
    ) -> None:
        self._settings = settings or RingDeviceSettings()
        self._slots = SlotFeed(feed, self._settings.samples_per_slot)
        self._unit = unit
        self.ledger = ledger or Ledger()
        self.fault: SlotFault | None = None
        self.faults: deque[SlotFault] = deque()
        self.frozen = False
        self.ended = False
        self.on_demand = False
        self.patient = False
        self.identification: Mapping[int, bytes] = {}
        self._repetition = Repetition()
        self._n_frozen = 0
        self._n_looks = 0
        self.first_sequence = self._settings.first_sequence
        self._n_restarts = 0
        self._newest = 0
        first = self._slots.take()
        if first is None:
            raise ConfigError(f"the feed has not one slot of {self._settings.samples_per_slot}")
        self.layout = layout_of(first, self._settings)
        self._watch = ReadingWatch(self.layout)
        base = self._settings.base_address
        self.memory = RegisterMemory(base, self.layout.end_address - base)
        self._power_up(first, self._settings.first_index)

    @property
    def newest(self) -> int:
        """Sequence number of the newest slot."""
        return self._newest

    def produce(self, n_slots: int = 1, fault: SlotFault | None = None) -> None:
        """Let so many slot times pass; each slot passes through the fault."""
        for _ in range(0 if self.frozen else n_slots):
            if self._n_frozen:
                self._n_frozen -= 1
                continue
            ahead = self._slots.peek()
            if ahead is None:
                self.ended = True
                return
            if self.patient and self._must_wait(ahead):
                return
            self._position += 1
            if ahead.epoch != self._feed_epoch or self._slots.number(ahead) <= self._position:
                self._take(fault)

    def produce_unpaced(self, n_slots: int) -> None:
        """Let the next slots come, however long a gap takes, but not so that any is overwritten.

        Parameters
        ----------
        n_slots
            At most so many places of the ring are used up, unless the very next slot is further.
        """
        if self._n_frozen:
            self._n_frozen -= 1
            return
        limit = self._position + n_slots
        for n_taken in range(0 if self.frozen else n_slots):
            ahead = self._slots.peek()
            if ahead is None:
                self.ended = True
                return
            anew = ahead.epoch != self._feed_epoch
            if n_taken and (anew or self._slots.number(ahead) > limit):
                return
            self._take(None)
            if not n_taken:
                limit = self._position + n_slots - 1

    def restart(self, next_epoch: bool = True) -> None:
        """Power off and on: ring empty, counters at their start, next epoch if it tells."""
        first = self._slots.take()
        if first is None:
            self.ended = True
            return
        self._n_restarts += next_epoch
        self._power_up(first, self._settings.first_index or 0)

    @property
    def step_s(self) -> float:
        """Time that one slot covers."""
        return self.layout.slot_duration_s

    @property
    def drained(self) -> bool:
        """Whether the feed has ended and a reader has read all and looked again."""
        return self.ended and self._n_looks >= _LAST_LOOKS

    def read_registers(self, function: int, address: int, count: int) -> bytes | None:  # noqa: ARG002
        """Answer a read, the same by both functions; None if some registers do not exist."""
        asked = range(address, address + count)
        if self._settings.base_address in asked:
            self._look()
        data = self.memory.read(address, count)
        self._watch.note_read(asked)
        return data

    def read_bits(self, function: int, address: int, count: int) -> None:
        """There are no bits."""

    def read_fifo(self, address: int) -> None:
        """There is no queue."""

    def fault_names(self) -> list[str]:
        """Names of what can happen to slots."""
        return [*_SLOT_FAULTS, "repeat", "freeze", "reset_epoch"]

    def spoil(self, fault: str, count: int) -> None:
        """Let one of these happen to the next slots."""
        match fault:
            case "freeze":
                self._n_frozen += count
            case "reset_epoch":
                for _ in range(count):
                    self.restart()
            case "repeat":
                self.faults.extend([self._repetition] * count)
            case _:
                self.faults.extend([_SLOT_FAULTS[fault]] * count)

    def _look(self) -> None:
        """Note that a reader looks at the header, whether there is something new."""
        self._watch.note_look()
        if not self._watch.waiting:
            return
        if self.on_demand and not self.ended:
            self.produce_unpaced(max(1, (self.layout.n_slots - 2) // 2))
        self._n_looks += self.ended

    def _must_wait(self, ahead: RawBlock) -> bool:
        """Whether a slot would come before its reader can take it."""
        if not self._watch.anything_read:
            return True
        if ahead.epoch != self._feed_epoch:
            return self._watch.n_unread > 0
        n_ahead = self._slots.number(ahead) - self._number
        return self._watch.n_unread > max(0, self.layout.n_slots - 2 - n_ahead)

    def _take(self, fault: SlotFault | None) -> None:
        raw = self._slots.take()
        if raw is None:
            return
        if raw.epoch != self._feed_epoch:
            self._power_up(raw, self._settings.first_index)
            return
        n_slots = self._slots.number(raw) - self._number
        self._newest = (self._newest + n_slots) % U32
        self._write(raw, n_slots, self._spoilers(fault))

    def _power_up(self, first: RawBlock, first_index: int | None) -> None:
        self.memory.clear()
        self._watch.begin_anew()
        self._feed_epoch = first.epoch
        self.epoch = (first.epoch + self._n_restarts) % U32
        self._newest = self.first_sequence
        self._index_offset = 0 if first_index is None else first_index - first.first_index
        self._write(first, 1, [])

    def _write(self, raw: RawBlock, n_slots: int, spoilers: list[SlotFault]) -> None:
        """Write a slot that is so many places after the one before."""
        self._number = self._position = self._slots.number(raw)
        self._watch.note_written(self._newest)
        self._n_looks = 0
        right = self._slot(raw)
        slot: Slot | None = right
        for spoil in spoilers:
            slot = slot and spoil(slot)
        self._repetition.note(right)
        if slot is not None:
            address = self.layout.slot_address(self._newest)
            self.memory.write(address, encode_slot(slot))
        header = encode_header(RingHeader(self.layout, self.epoch, self._newest))
        self.memory.write(self._settings.base_address, header + encode_slow(raw.slow))
        self.ledger.offer(self._unit, self.epoch, n_slots * self.layout.samples_per_slot)

    def _spoilers(self, fault: SlotFault | None) -> list[SlotFault]:
        queued = [self.faults.popleft()] if self.faults else []
        always = fault or self.fault
        return [*queued, always] if always else queued

    def _slot(self, raw: RawBlock) -> Slot:
        seconds, microseconds = divmod(raw.start_ns // 1000, 1_000_000)
        return Slot(
            sequence=self._newest,
            first_index=(raw.first_index + self._index_offset) % U32,
            seconds=seconds,
            microseconds=microseconds,
            ok_bits=sum(1 << c for c, ok in enumerate(raw.ok) if ok),
            counts=raw.counts.astype(np.int16, copy=False),
            trailer=self._newest & 0xFFFF,
            epoch=self.epoch,
            slow=raw.slow,
        )
