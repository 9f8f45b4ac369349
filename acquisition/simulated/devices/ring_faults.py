"""Slot faults of a simulated block ring, and tracker of the slots that a client has read."""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TypeAlias

from acquisition.modbus.ring_profile import U32, RingLayout, Slot
from acquisition.modbus.timeline import ahead

SlotFault: TypeAlias = Callable[[Slot], Slot | None]
"""Function from the correct slot to the slot that is written; None writes no slot."""


def dropped(slot: Slot) -> None:
    """Return None for any slot: the slot is not written, and the sequence number continues."""


def torn(slot: Slot) -> Slot:
    """Return the slot with a trailer that does not match its sequence number: a torn write."""
    return replace(slot, trailer=slot.trailer ^ 0x5A5A)


def damaged(slot: Slot) -> Slot:
    """Return the slot with a wrong checksum."""
    return replace(slot, damage=slot.damage ^ 0x5A5A5A5A)


def wrong_sequence(slot: Slot) -> Slot:
    """Return the slot with the sequence number of the next slot."""
    sequence = (slot.sequence + 1) % U32
    return replace(slot, sequence=sequence, trailer=sequence & 0xFFFF)


def wrong_index(slot: Slot) -> Slot:
    """Return the slot with a sample index that is too high by one."""
    return replace(slot, first_index=(slot.first_index + 1) % U32)


def wrong_time(slot: Slot) -> Slot:
    """Return the slot with a time stamp in the year 2106."""
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
    """Tracker of the slots that a client has read, based on its register requests.

    A slot counts as read when its last register and those of all previous slots have been read. If
    a client reads the header, then the newest slot of this header, and then the header again, it
    has skipped the unread slots before the newest slot. Slots written after the header was read are
    unknown to the client and remain unread, even if their registers are read.

    Attributes
    ----------
    anything_read
        Whether any slot has ever been read.
    waiting
        Whether a client has read the header after it had read all slots.
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
        """Discard the records of all slots, because the ring has been cleared."""
        self._unread.clear()
        self._shown, self._shown_was_read = None, False

    def note_written(self, sequence: int) -> None:
        """Record the sequence number of a new slot."""
        self._unread.append(sequence)
        self._newest = sequence
        self.waiting = False

    def note_look(self) -> None:
        """Record a read of the header."""
        if self._shown is not None and self._shown_was_read:
            while self._unread and ahead(self._shown, self._unread[0]) >= 0:
                self._unread.popleft()
        self._shown, self._shown_was_read = self._newest, False
        self.waiting = not self._unread

    def note_read(self, asked: range) -> None:
        """Record a read of the registers with the addresses `asked`."""
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
        """Number of places of the ring from the oldest unread slot to the newest; 0 if none."""
        return (self._newest - self._unread[0]) % U32 + 1 if self._unread else 0
