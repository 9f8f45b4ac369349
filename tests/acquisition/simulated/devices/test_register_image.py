"""What a simulated device writes by a map is what padwatch reads by it."""

import math

import pytest

from acquisition.modbus.cells import ByteOrder, Cell, NumberType
from acquisition.modbus.decoding import MapDecoder, MapReading, ValueState
from acquisition.modbus.register_map import (
    CalendarTime,
    EpochTime,
    FlagCheck,
    FullScale,
    MapValue,
    Meaning,
    RegisterMap,
    ScaleRegister,
    Together,
)
from acquisition.simulated.devices.register_image import RegisterImage


class Device:
    """A device's registers, and what is read of them by the same map."""

    def __init__(self, *values: MapValue, ranges=None, **settings) -> None:
        registers = RegisterMap(values=values, **settings)
        self.decoder, self.image = MapDecoder(registers), RegisterImage(registers, ranges or {})

    def content(self) -> bytes:
        parts = []
        for request in self.decoder.plan.spans:
            image = self.image
            read = image.read_bits if request.function in (1, 2) else image.read_registers
            parts.append(read(request.function, request.address, request.count))
        return b"".join(parts)

    def read(self) -> MapReading:
        return self.decoder.read(self.content())


@pytest.mark.parametrize("number", [-250.0, 0.0, 0.3, 1999.5])
def test_a_scale_register_is_as_large_as_the_value_needs(number):
    value = MapValue(
        id="v",
        cell=Cell(address=609, type=NumberType.INT16),
        scale_register=ScaleRegister(cell=Cell(address=610, type=NumberType.INT16)),
    )
    device = Device(value, base=1, together=(Together(address=609, count=14),))
    device.image.put_value(value, number)

    reading = device.read()

    assert reading.values[0] == pytest.approx(number, abs=0.05)
    assert len(device.content()) == 28


@pytest.mark.parametrize(
    ("number", "state"), [(20.0, ValueState.OK), (900.0, ValueState.CLIPPED), (-900, 1)]
)
def test_a_range_is_told_by_the_device_and_clips(number, state):
    ends = [Cell(address=a, function=4, type=NumberType.FLOAT32) for a in (10, 12)]
    value = MapValue(
        id="v",
        cell=Cell(address=1, function=4),
        full_scale=FullScale(minimum=ends[0], maximum=ends[1]),
    )
    device = Device(value, ranges={"v": (-100.0, 100.0)})
    device.image.put_value(value, number)

    reading = device.read()

    assert reading.states[0] == state
    assert reading.values[0] == pytest.approx(max(-100.0, min(number, 100.0)), abs=0.002)


FLAGS = (
    {"mask": 0x0020, "set_means": Meaning.BAD},
    {"mask": 0x0021, "set_means": Meaning.OK},
    {"ok_values": (1,), "clipped_values": (2,)},
    {"mask": 0xFF00, "ok_values": (0, 1, 2)},
)
ONE_BIT = (
    {"mask": 1, "set_means": Meaning.OK},
    {"mask": 1, "set_means": Meaning.BAD},
    {"mask": 1, "ok_values": (0,)},
)
BIT = {"type": NumberType.BIT}


@pytest.mark.parametrize(
    ("flag", "cell"),
    [(flag, {"byte_order": o}) for flag in FLAGS for o in (ByteOrder.ABCD, ByteOrder.DCBA)]
    + [(flag, BIT | at) for flag in ONE_BIT for at in ({"bit": 3}, {"function": 2})],
)
@pytest.mark.parametrize("good", [True, False])
def test_a_flag_says_what_it_is_told_to_say(flag, cell, good):
    check = FlagCheck(cell=Cell(address=1, **cell), **flag)
    device = Device(MapValue(id="v", cell=Cell(address=0), flags=(check,)))
    device.image.put_flag(check, not good)
    device.image.put_flag(check, good)

    assert device.read().states[0] is (ValueState.OK if good else ValueState.FLAGGED)


@pytest.mark.parametrize(
    ("type_", "settings"),
    [
        ("float32", {}),
        ("int16", {"invalid_values": (0x8000,)}),
        ("uint16", {"invalid_values": (-1,)}),
        ("int16", {"invalid_below": -32000.0}),
        ("uint32", {"invalid_above": 1e6}),
    ],
)
def test_what_a_device_does_not_know_is_no_value(type_, settings):
    value = MapValue(id="v", cell=Cell(address=0, type=NumberType(type_)), **settings)
    device = Device(value)
    device.image.put_value(value, math.nan)

    assert device.read().states[0] is ValueState.INVALID


def test_bits_are_written_where_they_are_read_and_leave_the_others_of_a_register():
    cells = [
        Cell(address=3, type=NumberType.BIT, bit=5),
        Cell(address=3, type=NumberType.BIT, bit=13),
        Cell(address=3, type=NumberType.BIT, bit=0),
        Cell(address=8, function=1, type=NumberType.BIT),
        Cell(address=9, function=2, type=NumberType.BIT),
    ]
    values = tuple(MapValue(id=f"b{n}", cell=cell) for n, cell in enumerate(cells))
    device = Device(*values)
    bits = [1.0, 1.0, 0.0, 0.0, 1.0]
    for value, bit in zip(values, bits, strict=True):
        device.image.put_value(value, bit)

    assert device.read().values.tolist() == bits


@pytest.mark.parametrize(
    "time",
    [
        EpochTime(
            seconds=Cell(address=1, type=NumberType.UINT32, byte_order=ByteOrder.CDAB),
            parts=Cell(address=3),
            parts_per_s=1000.0,
        ),
        CalendarTime(first=Cell(address=1), utc_offset_s=3600.0),
    ],
)
def test_a_time_comes_back(time):
    device = Device(MapValue(id="v", cell=Cell(address=0)), time=time)
    device.image.put_time(1_800_000_123_250_000_000)

    found = device.read().time_ns

    assert found // 10**9 == 1_800_000_123


def test_a_register_that_the_map_does_not_name_does_not_exist():
    registers = RegisterMap(
        values=(MapValue(id="v", cell=Cell(address=0)),), together=(Together(address=4, count=3),)
    )
    image = RegisterImage(registers)

    assert image.read_registers(3, 0, 1) is not None
    assert image.read_registers(3, 0, 2) is None
    assert image.read_registers(4, 0, 1) is None
    assert image.read_registers(3, 4, 3) is not None
    assert image.read_bits(1, 0, 1) is None
