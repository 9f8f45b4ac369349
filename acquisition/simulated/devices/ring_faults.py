"""Faulty slots of a simulated block ring; `ReadingWatch`: which of its slots have been read."""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TypeAlias

from acquisition.modbus.ring_profile import U32, RingLayout, Slot
from acquisition.modbus.timeline import ahead

SlotFault: TypeAlias = Callable[[Slot], Slot | None]
"""Maps the right slot to the one that is written; None if none is."""


def dropped(slot: Slot) -> None:
    """Do not write the slot; the sequence continues."""


def torn(slot: Slot) -> Slot:
    """Leave the tail of another slot behind the samples."""
    return replace(slot, trailer=slot.trailer ^ 0x5A5A)


def damaged(slot: Slot) -> Slot:
    """Write a wrong checksum."""
    return replace(slot, damage=slot.damage ^ 0x5A5A5A5A)


def wrong_sequence(slot: Slot) -> Slot:
    """Write the sequence number of another place."""
    sequence = (slot.sequence + 1) % U32
    return replace(slot, sequence=sequence, trailer=sequence & 0xFFFF)


def wrong_index(slot: Slot) -> Slot:
    """Count one sample too many."""
    return replace(slot, first_index=(slot.first_index + 1) % U32)


def wrong_time(slot: Slot) -> Slot:
    """Stamp the slot with 2106."""
    return replace(slot, seconds=U32 - 1)


SLOT_FAULTS: Mapping[str, SlotFault] = {
    "drop": dropped,
    "tear": torn,
    "damage": damaged,
    "wrong_sequence": wrong_sequence,
    "wrong_index": wrong_index,
    "wrong_time": wrong_time,
}


class ReadingWatch:
    """Tracks written slots and requested registers.

    A slot is read when its last register has been read, and those of all slots before it. A reader
    that reads the header, and then the newest slot shown there before it reads the header again,
    has skipped the unread slots before it. Slots that came later are unknown to the reader, even
    where it reads their places.

    Attributes
    ----------
    anything_read
        Whether any slot has ever been read.
    waiting
        Whether a reader has read the header after it had read all slots.
    """

    def __init__(self, layout: RingLayout) -> None:
        self._layout = layout
        self._unread: deque[int] = deque(maxlen=layout.n_slots)
        self._newest = 0
        self._shown: int | None = None
        self._shown_was_read = False
        self.anything_read = False
        self.waiting = False

    def clear(self) -> None:
        """Forget all slots, as the ring is empty."""
        self._unread.clear()
        self._shown, self._shown_was_read = None, False

    def note_written(self, sequence: int) -> None:
        """Note a new newest slot."""
        self._unread.append(sequence)
        self._newest = sequence
        self.waiting = False

    def note_look(self) -> None:
        """Note a read of the header."""
        if self._shown is not None and self._shown_was_read:
            while self._unread and ahead(self._shown, self._unread[0]) >= 0:
                self._unread.popleft()
        self._shown, self._shown_was_read = self._newest, False
        self.waiting = not self._unread

    def note_read(self, asked: range) -> None:
        """Note a read of registers."""
        ring = self._layout
        end = ring.ring_address + ring.slot_registers - 1
        first = -((end - asked.start) // ring.slot_stride)
        places = range(first, (asked.stop - 1 - end) // ring.slot_stride + 1)
        while self._unread and self._unread[0] % ring.n_slots in places:
            self._unread.popleft()
            self.anything_read = True
        self._shown_was_read |= self._shown is not None and self._shown % ring.n_slots in places

    @property
    def n_unread(self) -> int:
        """Number of places of the ring from the oldest unread slot to the newest."""
        return (self._newest - self._unread[0]) % U32 + 1 if self._unread else 0
