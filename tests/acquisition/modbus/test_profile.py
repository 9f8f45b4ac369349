"""Block-ring profile: what is written is what is read, and what is changed is seen."""

import dataclasses
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from acquisition.errors import ConfigError, FrameError
from acquisition.modbus.ring_profile import (
    RingHeader,
    RingLayout,
    Slot,
    decode_header,
    decode_slots,
)
from acquisition.simulated.devices.register_image import encode_header, encode_slot

u16 = st.integers(0, 2**16 - 1)
u32 = st.integers(0, 2**32 - 1)
LAYOUT = RingLayout(
    n_channels=3,
    samples_per_slot=4,
    n_slots=8,
    rate_mhz=600_000,
    n_slow=2,
    ring_address=20,
    slot_stride=31,
)


@st.composite
def layouts(draw: st.DrawFn) -> RingLayout:
    layout = RingLayout(
        n_channels=draw(st.integers(1, 32)),
        samples_per_slot=draw(st.integers(1, 200)),
        n_slots=draw(st.integers(2, 4)),
        rate_mhz=draw(st.integers(1, 2**32 - 1)),
        n_slow=draw(st.integers(0, 100)),
        ring_address=draw(st.integers(16, 500)),
        slot_stride=0,
    )
    stride = layout.slot_registers + draw(st.integers(0, 9))
    return dataclasses.replace(layout, slot_stride=stride)


@given(layout=layouts(), epoch=u32, newest=u32)
def test_a_header_reads_back_as_it_was_written(layout, epoch, newest):
    header = RingHeader(layout, epoch, newest)
    assert decode_header(encode_header(header)) == header


@given(epoch=u32, newest=u32, position=st.integers(0, 31), flip=st.integers(1, 255))
def test_no_header_with_a_changed_byte_is_believed(epoch, newest, position, flip):
    data = bytearray(encode_header(RingHeader(LAYOUT, epoch, newest)))
    data[position] ^= flip
    with pytest.raises((ConfigError, FrameError)):
        decode_header(bytes(data))


def equal_slots(a: Slot, b: Slot) -> bool:
    nothing = np.empty(0)
    a, b = (dataclasses.replace(slot, counts=nothing) for slot in (a, b))
    return repr(a) == repr(dataclasses.replace(b, blank=a.blank))


@given(
    numbers=st.tuples(u32, u32, u32, u32, u32),
    trailer=u16,
    counts=arrays(np.int16, (3, 4)),
    epoch=u32,
    slow=st.tuples(*[st.floats(width=32, allow_nan=False)] * 2),
    damage=u32,
)
def test_a_slot_keeps_epoch_slow_values_and_damage(numbers, trailer, counts, epoch, slow, damage):
    slot = Slot(*numbers, counts=counts, trailer=trailer, epoch=epoch, slow=slow, damage=damage)
    data = encode_slot(slot)
    assert len(data) == 2 * LAYOUT.slot_registers
    _, read = decode_slots(data + data, LAYOUT)
    np.testing.assert_array_equal(read.counts, counts)
    assert equal_slots(read, slot)


@given(
    counts=arrays(np.int16, (3, 4)),
    flips=st.dictionaries(
        st.integers(0, 2 * LAYOUT.slot_registers - 1), st.integers(1, 255), min_size=1
    ),
)
def test_a_slot_with_changed_bytes_is_not_whole(counts, flips):
    data = bytearray(encode_slot(Slot(3, 12, 5, 6, 7, counts, 3, epoch=1, slow=(1.0, 2.0))))
    assert decode_slots(bytes(data), LAYOUT)[0].whole
    for position, flip in flips.items():
        data[position] ^= flip
    assert not decode_slots(bytes(data), LAYOUT)[0].whole


def test_a_slot_of_zeros_is_blank_and_a_written_one_is_not():
    assert decode_slots(bytes(2 * LAYOUT.slot_registers), LAYOUT)[0].blank
    first = Slot(0, 0, 0, 0, 0, np.ones((3, 4), np.int16), 0, epoch=0, slow=(0.0, 0.0))
    assert not decode_slots(encode_slot(first), LAYOUT)[0].blank


def test_samples_lie_channel_by_channel_behind_slow_values_and_before_a_checksum():
    counts = np.arange(12, dtype=np.int16).reshape(3, 4)
    slot = Slot(
        0x0001_0002, 0x0003_0004, 5, 6, 0b101, counts, 2, epoch=0x0007_0008, slow=(1.0, 2.0)
    )
    data = encode_slot(slot)
    words = np.frombuffer(data, ">u2")
    assert words[:12].tolist() == [1, 2, 3, 4, 0, 5, 0, 6, 0, 5, 7, 8]
    assert words[12:16].tolist() == [0x3F80, 0, 0x4000, 0]
    assert words[16:29].tolist() == [*range(12), 2]
    assert int.from_bytes(data[-4:], "big") == zlib.crc32(data[:-4])


@pytest.mark.parametrize(
    ("register", "value", "complaint"),
    [
        (0, 0x5058, "magic is 0x5058, expected 0x5057"),
        (1, 3, "version is 3, expected 2"),
        (2, 0, "n_channels must be 1 to 32, got 0"),
        (2, 33, "n_channels must be 1 to 32, got 33"),
        (3, 0, "samples_per_slot must be 1 to 65535, got 0"),
        (4, 1, "n_slots must be 2 to 65535, got 1"),
        (4, 60000, "end of the ring must be"),
        (13, 22, "slot stride must be"),
    ],
)
def test_a_header_that_cannot_be_is_refused_with_what_was_found(register, value, complaint):
    words = np.frombuffer(encode_header(RingHeader(LAYOUT, 1, 1)), ">u2").copy()
    words[register] = value
    data = words.tobytes()[:28]
    with pytest.raises(ConfigError, match=complaint):
        decode_header(data + zlib.crc32(data).to_bytes(4, "big"))
