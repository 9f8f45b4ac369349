"""What a device's status registers and bits say of a value, with the polarity of its maker."""

import struct

import pytest

from acquisition.registers.cells import Cell, NumberType
from acquisition.registers.decoding import MapDecoder, ValueState
from acquisition.registers.register_map import FlagCheck, MapValue, Meaning, RegisterMap


def words(*numbers: int) -> bytes:
    return struct.pack(f">{len(numbers)}H", *numbers)


def one(value: MapValue, content: bytes) -> tuple[float, ValueState]:
    reading = MapDecoder(RegisterMap(values=(value,))).read(content)
    return reading.values[0], reading.states[0]


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
def test_a_status_register_is_read_with_the_polarity_of_its_maker(flag, word, state) -> None:
    check = FlagCheck(cell=Cell(address=1), **flag)
    value = MapValue(id="v", cell=Cell(address=0), flags=(check,))

    assert one(value, words(5, word)) == (5.0, state)


def test_flags_of_mixed_polarity_in_one_register_are_each_heard() -> None:
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
@pytest.mark.parametrize("good", [True, False])
@pytest.mark.parametrize(
    "flag",
    [
        {"set_means": Meaning.OK},
        {"set_means": Meaning.OK, "mask": 1},
        {"set_means": Meaning.BAD},
        {"ok_values": (1,)},
    ],
)
def test_a_single_bit_is_a_status_too(cell, good: bool, flag) -> None:
    is_set = good is (flag.get("set_means") is not Meaning.BAD)
    status = Cell(address=1, type=NumberType.BIT, **cell)
    value = MapValue(id="v", cell=Cell(address=0), flags=(FlagCheck(cell=status, **flag),))

    bit = words(is_set << 7) if "bit" in cell else bytes([is_set])
    content = bit + words(5) if "function" in cell else words(5) + bit

    assert one(value, content) == (5.0, ValueState.OK if good else ValueState.FLAGGED)
