"""What a reader has read, as far as a device that waits for it can see."""

import pytest

from acquisition.daq.reading_watch import ReadingWatch
from acquisition.modbus.ring_layout import RingLayout

N_SLOTS = 8


LAYOUT = RingLayout(1, 10, N_SLOTS, 600_000, 0, ring_address=100, slot_stride=40)
LOOK = ()


@pytest.mark.parametrize(
    ("written_read_or_looked", "n_unread", "waiting"),
    [
        pytest.param([(0, 1, 2), LOOK, [0, 1]], 1, False, id="one is left"),
        pytest.param([(0, 1, 2), LOOK, [0, 1], [2], LOOK], 0, True, id="read in order"),
        pytest.param([(0, 1, 2), LOOK, [2], LOOK], 0, True, id="older ones are left out"),
        pytest.param([(0,), LOOK, [0], (1, 2, 3), [3]], 3, False, id="the newest was not told of"),
        pytest.param([(0, 1), LOOK, (2, 3), [1], LOOK], 2, False, id="those after the look"),
        # read where the two slots before the first one would be, and the first one
        pytest.param(
            [(0,), LOOK, (1, 2, 3, 4, 5, 6), [6, 7, 0], LOOK], 6, False, id="places of older slots"
        ),
        pytest.param([(0, 1), LOOK, [0, 1], None, (0,), LOOK], 1, False, id="an empty ring"),
    ],
)
def test_a_slot_is_read_when_a_reader_that_was_told_of_it_cannot_come_back_for_it(
    written_read_or_looked, n_unread, waiting
) -> None:
    """Sequences in tuples are written, places in lists are read."""
    watch = ReadingWatch(LAYOUT)
    for done in written_read_or_looked:
        if done is None:
            watch.begin_anew()
        elif done == LOOK:
            watch.note_look()
        for number in done or ():
            if isinstance(done, tuple):
                watch.note_written(number)
            else:
                start = LAYOUT.slot_address(number)
                watch.note_read(range(start, start + LAYOUT.slot_registers))
    assert (watch.n_unread, watch.waiting) == (n_unread, waiting)
