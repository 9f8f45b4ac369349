"""What a faulty device does to a slot on its way into the ring."""

import dataclasses
from collections import deque
from collections.abc import Callable
from typing import TypeAlias

from acquisition.modbus.ring_profile import U32, RingLayout, Slot
from acquisition.modbus.timeline import ahead

SlotFault: TypeAlias = Callable[[Slot], Slot | None]
"""Takes the right slot, gives what is written instead; None if nothing is."""


def dropped(slot: Slot) -> None:
    """Never write the slot; the sequence goes on."""


def torn(slot: Slot) -> Slot:
    """Leave the tail of another slot behind the samples."""
    return dataclasses.replace(slot, trailer=slot.trailer ^ 0x5A5A)


def damaged(slot: Slot) -> Slot:
    """Write a checksum that does not fit."""
    return dataclasses.replace(slot, damage=slot.damage ^ 0x5A5A5A5A)


def wrong_sequence(slot: Slot) -> Slot:
    """Write a sequence number that does not belong into this place."""
    sequence = (slot.sequence + 1) % U32
    return dataclasses.replace(slot, sequence=sequence, trailer=sequence & 0xFFFF)


def wrong_index(slot: Slot) -> Slot:
    """Count one sample too many."""
    return dataclasses.replace(slot, first_index=(slot.first_index + 1) % U32)


def wrong_time(slot: Slot) -> Slot:
    """Stamp the slot with 2106."""
    return dataclasses.replace(slot, seconds=U32 - 1)


def impossible_time(slot: Slot) -> Slot:
    """Stamp the slot with a second of a million and more microseconds."""
    return dataclasses.replace(slot, microseconds=slot.microseconds + 1_000_000)


class Repetition:
    """Write the samples of the slot before once more, with the next sequence number."""

    def __init__(self) -> None:
        self._before: Slot | None = None

    def note(self, slot: Slot) -> None:
        """Remember a slot, in case it is to be repeated."""
        self._before = slot

    def __call__(self, slot: Slot) -> Slot:
        """Give the remembered slot under the number of this one."""
        if self._before is None:
            return slot
        return dataclasses.replace(self._before, sequence=slot.sequence, trailer=slot.trailer)


class ReadingWatch:
    """Notes what is written and which registers are asked for.

    A slot counts as read when its last register was, and all before it were. A reader that was told
    of a newest slot and has read it before it looks at the header again leaves out what it has not
    read up to there. Of slots that came later it knows nothing, though it may read their places.

    Attributes
    ----------
    anything_read
        Whether any slot ever was.
    waiting
        Whether a reader has looked at the header after it had read all slots.
    """

    def __init__(self, layout: RingLayout) -> None:
        self._layout = layout
        self._unread: deque[int] = deque(maxlen=layout.n_slots)
        self._newest = 0
        self._told: int | None = None
        self._told_was_read = False
        self.anything_read = False
        self.waiting = False

    def begin_anew(self) -> None:
        """Forget all slots, as an empty ring does."""
        self._unread.clear()
        self._told, self._told_was_read = None, False

    def note_written(self, sequence: int) -> None:
        """Note the newest slot."""
        self._unread.append(sequence)
        self._newest = sequence
        self.waiting = False

    def note_look(self) -> None:
        """Note that the header is read."""
        if self._told is not None and self._told_was_read:
            while self._unread and ahead(self._told, self._unread[0]) >= 0:
                self._unread.popleft()
        self._told, self._told_was_read = self._newest, False
        self.waiting = not self._unread

    def note_read(self, asked: range) -> None:
        """Note that registers are read."""
        ring = self._layout
        end = ring.ring_address + ring.slot_registers - 1
        first = -((end - asked.start) // ring.slot_stride)
        places = range(first, (asked.stop - 1 - end) // ring.slot_stride + 1)
        while self._unread and self._unread[0] % ring.n_slots in places:
            self._unread.popleft()
            self.anything_read = True
        self._told_was_read |= self._told is not None and self._told % ring.n_slots in places

    @property
    def n_unread(self) -> int:
        """Places of the ring from the oldest slot that was not read to the newest."""
        return (self._newest - self._unread[0]) % U32 + 1 if self._unread else 0
