"""A map is read in the fewest requests, whole where it must be, and never beyond what it names."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.registers.cells import Cell, MapError, NumberType
from acquisition.registers.decoding import MapDecoder
from acquisition.registers.read_plan import plan_reads
from acquisition.registers.register_map import (
    FlagCheck,
    FullScale,
    MapValue,
    Meaning,
    RegisterMap,
    ScaleRegister,
    Together,
)

BIT_3 = Cell(address=0, type=NumberType.BIT, bit=3)


def value(address: int, type_: str = "uint16", **settings) -> MapValue:
    cell = Cell(address=address, type=NumberType(type_))
    return MapValue(id=f"v{address}", cell=cell, **settings)


def flag(mask: int = 0xFFFF, set_means=Meaning.BAD, ok_values=(), clipped_values=(), **cell):
    values = {"ok_values": ok_values, "clipped_values": clipped_values}
    return FlagCheck(cell=Cell(address=0, **cell), mask=mask, set_means=set_means, **values)


def requests(values, **settings) -> list[tuple[int, int, int]]:
    plan = plan_reads(RegisterMap(values=tuple(values), **settings))
    return [(r.function, r.start, r.count) for r in plan.requests]


def test_neighbours_are_read_together_and_nothing_between_others() -> None:
    assert requests([value(0), value(1, "float32"), value(4)]) == [(3, 0, 3), (3, 4, 1)]


def test_a_gap_is_read_along_only_where_that_is_allowed() -> None:
    assert requests([value(0), value(4)], max_gap=2) == [(3, 0, 1), (3, 4, 1)]
    assert requests([value(0), value(4)], max_gap=3) == [(3, 0, 5)]


def test_no_request_is_longer_than_the_device_allows() -> None:
    assert requests([value(n) for n in range(130)]) == [(3, 0, 125), (3, 125, 5)]
    assert requests([value(2 * n, "float32") for n in range(6)], max_registers=5) == [
        (3, 0, 4),
        (3, 4, 4),
        (3, 8, 4),
    ]


def test_a_block_of_which_one_value_is_used_is_read_whole() -> None:
    block = Together(address=609, count=14)
    assert requests([value(612)], base=1, together=(block,)) == [(3, 608, 14)]


def test_a_block_that_nothing_is_used_of_is_not_read() -> None:
    assert requests([value(1)], together=(Together(address=609, count=14),)) == [(3, 1, 1)]


def test_a_block_is_never_split() -> None:
    values = [value(n) for n in range(20)]
    blocks = (Together(address=8, count=4),)
    assert requests(values, max_registers=10, together=blocks) == [
        (3, 0, 8),
        (3, 8, 10),
        (3, 18, 2),
    ]


def test_coils_inputs_holding_and_input_registers_are_read_apart() -> None:
    cells = [
        Cell(address=5, function=1, type=NumberType.BIT),
        Cell(address=5, function=2, type=NumberType.BIT),
        Cell(address=5, function=3),
        Cell(address=5, function=4),
    ]
    values = [MapValue(id=f"f{cell.function}", cell=cell) for cell in cells]
    assert requests(values) == [(1, 5, 1), (2, 5, 1), (3, 5, 1), (4, 5, 1)]


@pytest.mark.parametrize(
    ("base", "address"), [(0, 100), (1, 101), (40001, 40101), (400001, 400101)]
)
def test_addresses_are_written_as_in_the_manual(base: int, address: int) -> None:
    assert requests([value(address)], base=base) == [(3, 100, 1)]


@given(
    st.lists(st.tuples(st.integers(0, 6), st.sampled_from(["uint16", "float32", "float64"]))),
    st.integers(4, 125),
    st.integers(0, 8),
)
def test_every_cell_is_in_one_request_and_every_request_holds_cells(layout, most, gap) -> None:
    values, address = [], 0
    for skipped, type_ in layout:
        values.append(value(address + skipped, type_))
        address += skipped + values[-1].cell.n_places
    plan = plan_reads(RegisterMap(values=tuple(values), max_registers=most, max_gap=gap))

    read = [a for r in plan.requests for a in range(r.start, r.stop)]
    named = {a for v in values for a in range(v.cell.start(0), v.cell.stop(0))}
    assert len(read) == len(set(read))
    assert named <= set(read)
    assert all(r.count <= most for r in plan.requests)
    if gap == 0:
        assert named == set(read)
    for v in values:
        plan.request_of(v.cell)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ((value(0, "float32"), value(1)), "value 'v0'"),
        ([MapValue(id=id_, cell=BIT_3) for id_ in "ab"], "value 'a'"),
        ((value(0), value(0)), "register"),
    ],
)
def test_two_values_on_one_register_are_refused(values, said: str) -> None:
    with pytest.raises(MapError, match=said) as refusal:
        RegisterMap(values=tuple(values))
    assert refusal.value.at[:2] == ("value", 1)


def test_different_bits_of_one_register_are_two_values() -> None:
    cells = [Cell(address=0, type=NumberType.BIT, bit=bit) for bit in (3, 4)]
    values = [MapValue(id=f"b{cell.bit}", cell=cell) for cell in cells]
    assert requests(values) == [(3, 0, 1)]


def test_the_same_address_of_another_function_is_another_register() -> None:
    values = [value(0), MapValue(id="other", cell=Cell(address=0, function=4))]
    assert requests(values) == [(3, 0, 1), (4, 0, 1)]


@pytest.mark.parametrize(
    ("build", "said"),
    [
        (lambda: Cell(address=0, function=6), "must be 1, 2, 3 or 4, got 6"),
        (lambda: Cell(address=0, function=1), "single bits"),
        (lambda: Cell(address=0, type=NumberType.BIT), "number of a bit"),
        (lambda: Cell(address=0, bit=2), "number of a bit"),
        (lambda: Cell(address=0, type=NumberType.BIT, bit=16), "0 to 15, got 16"),
        (lambda: FlagCheck(cell=Cell(address=0), mask=0, set_means=Meaning.BAD), "0x0001"),
        (lambda: FlagCheck(cell=Cell(address=0)), "must be given"),
        (lambda: flag(type=NumberType.FLOAT32), "whole numbers"),
        (lambda: flag(type=NumberType.BIT, function=2, mask=2), "one bit"),
        (lambda: flag(clipped_values=(1,)), "with ok_values"),
        (lambda: flag(set_means=None, ok_values=(0, 16), mask=0x00F0), "0 to 15, got 16"),
        (lambda: flag(set_means=None, ok_values=(0,), clipped_values=(-1,)), "got -1"),
        (lambda: ScaleRegister(cell=Cell(address=0), divisor=0.0), "must not be 0"),
        (lambda: FullScale(minimum=1.0, maximum=1.0), "must differ"),
        (lambda: FullScale(minimum=0.0, maximum=1.0, raw_minimum=9, raw_maximum=9), "below raw"),
        (lambda: value(0, scale=0.0), "must not be 0"),
        (lambda: value(0, invalid_below=5.0, invalid_above=5.0), "below invalid_above"),
        (lambda: value(0, invalid_values=(0.5,)), "whole number of 16 bits, got 0.5"),
        (lambda: value(0, invalid_values=(0x18000,)), "whole number of 16 bits, got 98304"),
        (lambda: value(0, "int32", invalid_values=(-(2**31) - 1,)), "whole number of 32 bits"),
        (lambda: Together(address=0, count=126), "125"),
        (lambda: Together(address=0, count=2, function=2), "3 or 4"),
        (lambda: RegisterMap(values=(value(0),), base=2), "must be 0, 1"),
        (lambda: RegisterMap(values=(value(0),), base=1), "must be 1 to 65536"),
        (lambda: RegisterMap(values=(value(65535, "int32"),)), "must be 0 to 65534"),
        (lambda: RegisterMap(values=(value(0),), max_registers=126), "1 to 125"),
        (lambda: RegisterMap(values=(value(0),), max_gap=125), "0 to 124"),
        (
            lambda: RegisterMap(
                values=(value(0),), max_registers=10, together=(Together(address=0, count=11),)
            ),
            "max_registers, 10",
        ),
    ],
)
def test_what_no_device_can_have_is_refused_with_what_is_allowed(build, said: str) -> None:
    with pytest.raises(MapError, match=said):
        build()


def test_a_block_that_cuts_a_number_in_two_is_refused() -> None:
    with pytest.raises(MapError, match="cuts the number at 9 in two"):
        requests([value(9, "float32")], together=(Together(address=10, count=4),))


def test_blocks_that_share_a_register_are_refused() -> None:
    blocks = (Together(address=10, count=4), Together(address=13, count=4))
    with pytest.raises(MapError, match="share register 13"):
        requests([value(10)], together=blocks)


def test_a_value_and_its_scale_register_must_be_read_together() -> None:
    scale = ScaleRegister(cell=Cell(address=612))
    registers = RegisterMap(values=(value(609, scale_register=scale),))

    with pytest.raises(MapError, match="address = 609"):
        MapDecoder(registers)
