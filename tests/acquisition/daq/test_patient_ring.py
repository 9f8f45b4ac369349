"""A device that plays a recording waits for its reader: nothing is overwritten unread."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from acquisition.daq.ring_device import RingDevice
from acquisition.daq.ring_shape import RingDeviceSettings
from acquisition.raw import FeedEndedError, RawBlock

N_SLOTS = 8
SLOT = 50


class Played:
    """A recording of twelve slots, of which three are missing, and of twelve after a restart."""

    def __init__(self, feed) -> None:
        raws = [feed.advance(SLOT) for _ in range(24)]
        later = [
            replace(raw, epoch=8, first_index=raw.first_index - 12 * SLOT) for raw in raws[12:]
        ]
        self._raws = raws[:4] + raws[7:12] + later

    def advance(self, n_samples: int) -> RawBlock:  # noqa: ARG002 - blocks are slots
        if not self._raws:
            raise FeedEndedError
        return self._raws.pop(0)


@pytest.fixture
def device(counting_feed: Callable) -> RingDevice:
    built = RingDevice(Played(counting_feed()), settings=RingDeviceSettings(n_slots=N_SLOTS))
    built.patient = True
    built.produce(1000)
    assert built.newest == 0  # a reader that has not begun would leave out what came before
    read(built, 0)
    return built


def read(device: RingDevice, sequence: int) -> None:
    device.read_registers(3, device.layout.slot_address(sequence), device.layout.slot_registers)


def test_time_stands_still_when_the_ring_is_full_of_what_nobody_has_read(device) -> None:
    device.produce(1000)
    assert device.newest == 3  # the next slot is 7, four places on
    read(device, 2)
    device.produce(1000)
    assert device.newest == 3
    read(device, 1)
    device.produce(1000)
    assert device.newest == 7


def test_a_restart_waits_until_the_last_slot_was_read(device) -> None:
    for sequences in (range(1, 4), range(7, 11)):
        device.produce(1000)
        for sequence in sequences:
            read(device, sequence)
    device.produce(1000)
    assert (device.epoch, device.newest) == (7, 11)
    read(device, 11)
    device.produce(1)
    assert (device.epoch, device.newest) == (8, 0)
