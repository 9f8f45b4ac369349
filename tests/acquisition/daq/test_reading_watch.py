"""What a reader has read, as far as a device that waits for it can see."""

import pytest

from acquisition.daq.reading_watch import ReadingWatch
from acquisition.modbus.ring_layout import RingLayout

N_SLOTS = 8


class Seen:
    """A watch over a ring of eight slots."""

    def __init__(self) -> None:
        self.layout = RingLayout(
            n_channels=1,
            samples_per_slot=10,
            n_slots=N_SLOTS,
            rate_mhz=600_000,
            n_slow=0,
            ring_address=100,
            slot_stride=40,
        )
        self.watch = ReadingWatch(self.layout)

    def write(self, *sequences: int) -> None:
        for sequence in sequences:
            self.watch.note_written(sequence)

    def read(self, *places: int) -> None:
        for place in places:
            start = self.layout.slot_address(place)
            self.watch.note_read(range(start, start + self.layout.slot_registers))


@pytest.fixture
def seen() -> Seen:
    return Seen()


def test_slots_that_are_read_in_order_are_read(seen: Seen) -> None:
    seen.write(0, 1, 2)
    seen.watch.note_look()
    seen.read(0, 1)
    assert seen.watch.n_unread == 1
    seen.read(2)
    seen.watch.note_look()
    assert (seen.watch.n_unread, seen.watch.waiting) == (0, True)


def test_who_reads_the_newest_that_it_was_told_of_leaves_out_the_older_ones(seen: Seen) -> None:
    seen.write(0, 1, 2)
    seen.watch.note_look()
    seen.read(2)
    seen.watch.note_look()
    assert (seen.watch.n_unread, seen.watch.waiting) == (0, True)


def test_a_place_that_is_read_for_an_older_slot_tells_nothing_of_the_newest(seen: Seen) -> None:
    seen.write(0)
    seen.watch.note_look()
    seen.write(1, 2, 3, 4, 5, 6)
    seen.read(6, 7, 0)  # where the two slots before the first one would be, and the first one
    seen.watch.note_look()
    assert (seen.watch.n_unread, seen.watch.waiting) == (6, False)


def test_slots_that_came_after_the_look_are_still_to_be_read(seen: Seen) -> None:
    seen.write(0, 1)
    seen.watch.note_look()
    seen.write(2, 3)
    seen.read(1)
    seen.watch.note_look()
    assert seen.watch.n_unread == 2


def test_an_empty_ring_has_nothing_that_anybody_was_told_of(seen: Seen) -> None:
    seen.write(0, 1)
    seen.watch.note_look()
    seen.read(0, 1)
    seen.watch.begin_anew()
    seen.write(0)
    seen.watch.note_look()
    assert (seen.watch.n_unread, seen.watch.waiting) == (1, False)
