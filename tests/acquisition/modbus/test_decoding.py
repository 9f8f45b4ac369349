"""What stands in a device's registers comes out as its manual says, in every byte order.

Below `Device`: what a simulated device writes by a map is what padwatch reads by it.
"""

import math
import struct

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

STRUCT = {"int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "float32": "f", "float64": "d"}


def registers_of(number: float, type_: str, order: str) -> bytes:
    """What a device of that byte order holds, made by another way than padwatch's."""
    data = struct.pack(f">{STRUCT[type_]}", number)
    words = [data[n : n + 2] for n in range(0, len(data), 2)]
    if order in ("CDAB", "DCBA"):
        words.reverse()
    if order in ("BADC", "DCBA"):
        words = [word[::-1] for word in words]
    return b"".join(words)


def words(*numbers: int) -> bytes:
    return struct.pack(f">{len(numbers)}H", *(n % 65536 for n in numbers))


def one(value: MapValue, content: bytes, **settings) -> tuple[float, ValueState]:
    reading = MapDecoder(RegisterMap(values=(value,), **settings)).read(content)
    return reading.values[0], reading.states[0]


@pytest.mark.parametrize("order", [order.value for order in ByteOrder])
@pytest.mark.parametrize("type_", list(STRUCT))
def test_every_type_comes_back_from_every_byte_order(type_, order):
    number = {"int16": -12345, "uint16": 54321, "int32": -1234567890, "uint32": 4012345678}.get(
        type_, -0.15625
    )
    cell = Cell(address=7, type=NumberType(type_), byte_order=ByteOrder(order))

    assert one(MapValue(id="v", cell=cell), registers_of(number, type_, order)) == (number, 0)


SKF = MapValue(
    id="v",
    cell=Cell(address=609, type=NumberType.INT16),
    scale_register=ScaleRegister(cell=Cell(address=610, type=NumberType.INT16)),
)


def test_an_skf_value_is_its_mantissa_times_its_scale_register():
    settings = {"base": 1, "together": (Together(address=609, count=2),)}

    found, state = one(SKF, words(-16384, 200), **settings)

    assert found == pytest.approx(-16384 / 32767 * 200)
    assert state is ValueState.OK


VM600 = MapValue(
    id="v",
    cell=Cell(address=1, function=4),
    full_scale=FullScale(
        minimum=Cell(address=100, function=4, type=NumberType.FLOAT32),
        maximum=Cell(address=102, function=4, type=NumberType.FLOAT32),
    ),
)


@pytest.mark.parametrize(
    ("raw", "expected", "state"),
    [
        (0, -10.0, ValueState.CLIPPED),
        (1, -10.0 + 60.0 / 65535, ValueState.OK),
        (0xFFFE, 50.0 - 60.0 / 65535, ValueState.OK),
        (0xFFFF, 50.0, ValueState.CLIPPED),
    ],
)
def test_a_vm600_reading_at_the_end_of_its_scale_is_clipped(raw, expected, state):
    found = one(VM600, words(raw) + struct.pack(">ff", -10.0, 50.0))

    assert found == (pytest.approx(expected), state)


def test_without_a_scale_or_a_range_there_is_no_value_instead_of_zero():
    assert one(SKF, words(12345, 0))[1] is ValueState.INVALID
    assert one(VM600, words(7, 0, 0, 0, 0))[1] is ValueState.INVALID


@pytest.mark.parametrize(
    ("type_", "settings", "raw", "is_valid"),
    [
        ("int16", {"invalid_values": (0x8000,)}, -32768, False),
        ("int16", {"invalid_values": (-32768,)}, -32768, False),
        ("uint16", {"invalid_values": (-1,)}, 0xFFFF, False),
        ("int16", {"invalid_below": -32000}, -32001, False),
        ("int16", {"invalid_below": -32000}, -32000, True),
        ("int32", {"invalid_below": -32000}, -32001, False),
        ("float32", {"invalid_below": -32000}, -32001.0, False),
        ("uint32", {"invalid_above": 1e6}, 1000001, False),
        ("float32", {}, math.nan, False),
        ("float32", {}, -math.inf, False),
        ("float32", {"invalid_values": (-9999.0,)}, -9999.0, False),
        ("float32", {"invalid_values": (-9999.9,)}, -9999.9, False),
        ("float32", {"invalid_values": (1e300,)}, -9999.9, True),
        ("float64", {"invalid_values": (-9999.9,)}, -9999.9, False),
        ("int16", {"scale": 100.0, "invalid_values": (100,)}, 1, True),
    ],
)
def test_a_number_that_stands_for_an_error_is_no_value(type_, settings, raw, is_valid):
    value = MapValue(id="v", cell=Cell(address=0, type=NumberType(type_)), **settings)

    state = one(value, registers_of(raw, type_, "ABCD"))[1]

    assert state is (ValueState.OK if is_valid else ValueState.INVALID)


def test_bits_are_found_in_registers_coils_and_discrete_inputs():
    bits = {
        "low": Cell(address=3, type=NumberType.BIT, bit=0),
        "high": Cell(address=3, type=NumberType.BIT, bit=15),
        "coil": Cell(address=1010, function=1, type=NumberType.BIT),
        "input": Cell(address=1001, function=2, type=NumberType.BIT),
        "later": Cell(address=1010, function=2, type=NumberType.BIT),
    }
    values = tuple(MapValue(id=id_, cell=cell) for id_, cell in bits.items())
    decoder = MapDecoder(RegisterMap(values=values, base=1, max_gap=10))
    counts = [(r.function, r.address, r.count) for r in decoder.plan.spans]

    assert counts == [(1, 1009, 1), (2, 1000, 10), (3, 2, 1)]
    replies = b"\xfe" + b"\x01\xfd" + b"\x80\x00"
    assert decoder.read(replies).values.tolist() == [0.0, 1.0, 0.0, 1.0, 0.0]
    replies = b"\x01" + b"\xfe\x02" + b"\x00\x01"
    assert decoder.read(replies).values.tolist() == [1.0, 0.0, 1.0, 0.0, 1.0]


def test_scale_and_offset_are_taken_after_all_else():
    value = MapValue(id="v", cell=Cell(address=0), scale=0.001, offset=-2.0)

    assert one(value, words(3500))[0] == pytest.approx(1.5)


def test_the_device_says_when_it_measured():
    """AMC VIBRO: day first; GC-IMS: seconds with the low word first."""
    value = MapValue(id="v", cell=Cell(address=0))
    fields = ("day", "month", "year", "hour", "minute", "second")
    calendar = CalendarTime(first=Cell(address=1), fields=fields, utc_offset_s=-10800)
    epoch = EpochTime(
        seconds=Cell(address=1, type=NumberType.UINT32, byte_order=ByteOrder.CDAB),
        parts=Cell(address=3, type=NumberType.UINT32),
    )
    content = {
        calendar: words(0, 31, 12, 25, 21, 30, 15),
        epoch: words(0, 0x1234, 0x6789) + struct.pack(">I", 250_000),
    }

    times = [
        MapDecoder(RegisterMap(values=(value,), time=t)).read(c).time_ns for t, c in content.items()
    ]

    assert times == [1_767_227_415_000_000_000, 0x67891234 * 10**9 + 250_000_000]


FLOAT = Cell(address=1, type=NumberType.FLOAT64)
PARTS = Cell(address=5, type=NumberType.FLOAT32)


def test_a_device_whose_clock_makes_no_sense_has_none():
    value = MapValue(id="v", cell=Cell(address=0))
    for time, content in (
        (CalendarTime(first=Cell(address=1)), words(0, 25, 13, 1, 0, 0, 0)),
        (CalendarTime(first=Cell(address=1)), words(0, 9999, 12, 31, 23, 59, 59)),
        (EpochTime(seconds=Cell(address=1, type=NumberType.UINT32)), words(0, 0, 0)),
        (EpochTime(seconds=FLOAT), words(0) + struct.pack(">d", 1e300)),
        (EpochTime(seconds=FLOAT), words(0) + struct.pack(">d", 2.0**34)),
        (EpochTime(seconds=FLOAT, parts=PARTS), words(0) + struct.pack(">df", 1.8e9, 1e38)),
        (EpochTime(seconds=FLOAT, parts=PARTS), words(0) + struct.pack(">df", 1e300, -1e38)),
    ):
        decoder = MapDecoder(RegisterMap(values=(value,), time=time))
        assert decoder.read(content).time_ns is None


def test_a_heartbeat_alone_says_whether_the_device_lives():
    value = MapValue(id="v", cell=Cell(address=0))
    beating = MapDecoder(RegisterMap(values=(value,), heartbeat=Cell(address=1)))
    silent = MapDecoder(RegisterMap(values=(value,)))

    assert beating.read(words(1, 5)).alive == beating.read(words(2, 5)).alive
    assert beating.read(words(1, 5)).alive != beating.read(words(1, 6)).alive
    assert silent.read(words(1)).alive != silent.read(words(2)).alive


@pytest.mark.parametrize(
    ("flag", "word", "state"),
    [
        ({"mask": 0x0020, "set_means": Meaning.BAD}, 0x0020, ValueState.FLAGGED),
        ({"mask": 0x0060, "set_means": Meaning.BAD}, 0x0040, ValueState.FLAGGED),
        ({"mask": 0x0020, "set_means": Meaning.BAD}, 0xFFDF, ValueState.OK),
        ({"mask": 0x0021, "set_means": Meaning.OK}, 0x0021, ValueState.OK),
        ({"mask": 0x0021, "set_means": Meaning.OK}, 0x0001, ValueState.FLAGGED),
        ({"ok_values": (1,), "clipped_values": (2,)}, 1, ValueState.OK),
        ({"ok_values": (1,), "clipped_values": (2,)}, 2, ValueState.CLIPPED),
        ({"ok_values": (1,), "clipped_values": (2,)}, 0, ValueState.FLAGGED),
        ({"mask": 0xFF00, "ok_values": (0, 1, 2)}, 0x02FF, ValueState.OK),
        ({"mask": 0xFF00, "ok_values": (0, 1, 2)}, 0x0300, ValueState.FLAGGED),
    ],
)
def test_a_status_register_is_read_with_the_polarity_of_its_maker(flag, word, state):
    check = FlagCheck(cell=Cell(address=1), **flag)
    value = MapValue(id="v", cell=Cell(address=0), flags=(check,))

    assert one(value, words(5, word)) == (5.0, state)


def test_flags_of_mixed_polarity_in_one_register_are_each_heard():
    """VM600: bit 5 set means the sensor is OK, bits 6 to 11 set mean an error."""
    status = Cell(address=1)
    checks = (
        FlagCheck(cell=status, mask=0x0021, set_means=Meaning.OK),
        FlagCheck(cell=status, mask=0x0FC0, set_means=Meaning.BAD),
    )
    value = MapValue(id="v", cell=Cell(address=0), flags=checks)

    states = [one(value, words(5, word))[1] for word in (0x0021, 0x0001, 0x0121, 0x003F)]

    flagged = ValueState.FLAGGED
    assert states == [ValueState.OK, flagged, flagged, ValueState.OK]


@pytest.mark.parametrize("cell", [{"function": 2}, {"bit": 7}])
@pytest.mark.parametrize(
    ("flag", "bit", "state"),
    [
        ({"set_means": Meaning.OK}, 1, ValueState.OK),
        ({"set_means": Meaning.OK}, 0, ValueState.FLAGGED),
        ({"set_means": Meaning.BAD}, 0, ValueState.OK),
        ({"set_means": Meaning.BAD}, 1, ValueState.FLAGGED),
        ({"ok_values": (1,)}, 1, ValueState.OK),
        ({"ok_values": (1,)}, 0, ValueState.FLAGGED),
    ],
)
def test_a_single_bit_is_a_status_too(cell, flag, bit, state):
    check = FlagCheck(cell=Cell(address=1, type=NumberType.BIT, **cell), mask=1, **flag)
    value = MapValue(id="v", cell=Cell(address=0), flags=(check,))

    content = words(5, bit << 7) if "bit" in cell else bytes([bit]) + words(5)

    assert one(value, content) == (5.0, state)


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
