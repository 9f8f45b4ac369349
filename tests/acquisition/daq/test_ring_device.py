"""The simulated device books what it offers and lays it out as the profile says."""

import numpy as np
import pytest

from acquisition.daq import faults
from acquisition.daq.ledger import Ledger
from acquisition.daq.register_memory import RegisterMemory
from acquisition.daq.ring_device import RingDevice
from acquisition.daq.ring_shape import RingDeviceSettings
from acquisition.errors import ConfigError
from acquisition.modbus.profile import decode_header
from acquisition.modbus.slot import decode_slot, decode_slow


def slot_in(device: RingDevice, sequence: int):
    data = device.memory.read(device.layout.slot_address(sequence), device.layout.slot_registers)
    return decode_slot(data, device.layout)


def test_header_slow_values_and_slots_lie_where_the_header_says(counting_feed):
    device = RingDevice(counting_feed(), settings=RingDeviceSettings(base_address=100))
    device.produce(2)
    header = decode_header(device.memory.read(100, 16))
    assert header.layout == device.layout
    assert (header.epoch, header.newest) == (7, 2)
    np.testing.assert_array_equal(decode_slow(device.memory.read(116, 4)), (45.0, np.nan))
    slot = slot_in(device, 2)
    assert (slot.sequence, slot.first_index, slot.ok_bits, slot.torn) == (2, 100, 0b11, False)
    assert slot.start_ns == 1_767_225_600 * 10**9 + 166_666_000
    np.testing.assert_array_equal(slot.counts[0], np.arange(100, 150))


def test_the_ledger_books_what_was_offered_lost_or_not(counting_feed):
    ledger = Ledger()
    device = RingDevice(counting_feed(), unit="U7", ledger=ledger)
    RingDevice(counting_feed(), unit="U8", ledger=ledger)
    device.produce(3)
    device.produce(2, faults.dropped)
    device.restart()
    assert ledger.n_samples("U7", epoch=7) == 300
    assert ledger.n_samples("U7", epoch=8) == 50
    assert ledger.n_samples("U7") == 350
    assert ledger.n_samples("U8") == 50


def test_a_restarted_device_has_an_empty_ring_and_counts_from_zero(counting_feed):
    device = RingDevice(counting_feed())
    device.produce(5)
    device.restart()
    assert (device.newest, slot_in(device, 0).first_index) == (0, 0)
    assert slot_in(device, 1).blank


def test_random_loss_is_the_same_for_the_same_seed(counting_feed):
    def lost(seed: int) -> list[int]:
        device = RingDevice(counting_feed())
        device.fault = faults.RandomLoss(0.3, seed)
        device.produce(40)
        return [s for s in range(1, 41) if slot_in(device, s).blank]

    assert lost(1) == lost(1) != lost(2)
    assert 2 < len(lost(1)) < 30


def test_a_ring_that_does_not_fit_into_the_address_space_is_refused(counting_feed):
    with pytest.raises(ConfigError, match="end of the ring is"):
        RingDevice(counting_feed(n_channels=12), settings=RingDeviceSettings(n_slots=200))


def test_registers_that_do_not_exist_are_neither_written_nor_read():
    memory = RegisterMemory(100, 10)
    assert memory.read(99, 1) is None
    assert memory.read(105, 6) is None
    assert memory.read(105, 5) == bytes(10)
    with pytest.raises(ValueError, match="registers 109 to 111 are not in 100 to 110"):
        memory.write(109, bytes(4))
