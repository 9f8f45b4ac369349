"""Block-ring profile v1: what is written is what is read."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from acquisition.errors import ConfigError
from acquisition.modbus.profile import (
    RingHeader,
    decode_header,
    decode_progress,
    encode_header,
)
from acquisition.modbus.ring_layout import RingLayout
from acquisition.modbus.slot import Slot, decode_slot, decode_slow, encode_slot, encode_slow

u16 = st.integers(0, 2**16 - 1)
u32 = st.integers(0, 2**32 - 1)
LAYOUT = RingLayout(
    n_channels=3,
    samples_per_slot=4,
    n_slots=8,
    rate_mhz=600_000,
    n_slow=2,
    ring_address=20,
    slot_stride=23,
)


@st.composite
def layouts(draw: st.DrawFn) -> RingLayout:
    n_channels = draw(st.integers(1, 32))
    samples_per_slot = draw(st.integers(1, 200))
    n_registers = 11 + n_channels * samples_per_slot
    return RingLayout(
        n_channels=n_channels,
        samples_per_slot=samples_per_slot,
        n_slots=draw(st.integers(2, 4)),
        rate_mhz=draw(st.integers(1, 2**32 - 1)),
        n_slow=draw(st.integers(0, 100)),
        ring_address=draw(st.integers(16, 500)),
        slot_stride=n_registers + draw(st.integers(0, 9)),
    )


@given(layout=layouts(), epoch=u32, newest=u32)
def test_a_header_reads_back_as_it_was_written(layout, epoch, newest):
    header = RingHeader(layout, epoch, newest)
    assert decode_header(encode_header(header)) == header


@given(epoch=u32, newest=u32)
def test_epoch_and_newest_lie_where_progress_is_read(epoch, newest):
    data = encode_header(RingHeader(LAYOUT, epoch, newest))
    assert decode_progress(data[14:22]) == (epoch, newest)


@given(
    numbers=st.tuples(u32, u32, u32, u32, u32),
    trailer=u16,
    counts=arrays(np.int16, (3, 4)),
)
def test_a_slot_reads_back_as_it_was_written(numbers, trailer, counts):
    slot = Slot(*numbers, counts=counts, trailer=trailer)
    data = encode_slot(slot)
    assert len(data) == 2 * LAYOUT.slot_registers
    read = decode_slot(data, LAYOUT)
    np.testing.assert_array_equal(read.counts, counts)
    nothing = np.empty(0)
    assert dataclasses.replace(read, counts=nothing) == dataclasses.replace(slot, counts=nothing)


@given(st.lists(st.floats(width=32)))
def test_slow_values_read_back_as_they_were_written(values):
    np.testing.assert_array_equal(decode_slow(encode_slow(values)), values)


def test_samples_lie_channel_by_channel_behind_ten_registers():
    counts = np.arange(12, dtype=np.int16).reshape(3, 4)
    slot = Slot(0x0001_0002, 0x0003_0004, 5, 6, 0b101, counts, 0x0002)
    words = np.frombuffer(encode_slot(slot), ">u2")
    assert words.tolist() == [1, 2, 3, 4, 0, 5, 0, 6, 0, 5, *range(12), 2]


@pytest.mark.parametrize(
    ("register", "value", "complaint"),
    [
        (0, 0x5058, "magic is 0x5058, expected 0x5057"),
        (1, 2, "version is 2, expected 1"),
        (2, 0, "n_channels is 0"),
        (2, 33, "n_channels is 33"),
        (3, 0, "samples_per_slot is 0"),
        (4, 1, "n_slots is 1"),
        (4, 60000, "end of the ring is"),
        (13, 22, "slot stride is 22, allowed is 23"),
    ],
)
def test_a_header_that_cannot_be_is_refused_with_what_was_found(register, value, complaint):
    words = np.frombuffer(encode_header(RingHeader(LAYOUT, 1, 1)), ">u2").copy()
    words[register] = value
    with pytest.raises(ConfigError, match=complaint):
        decode_header(words.tobytes())
