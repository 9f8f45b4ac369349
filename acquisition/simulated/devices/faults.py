"""What a faulty device does to a slot on its way into the ring."""

import dataclasses
from collections.abc import Callable
from typing import TypeAlias

from acquisition.modbus.ring_profile import U32, Slot

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
