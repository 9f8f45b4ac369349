"""A map is read in the fewest requests, whole where it must be, and never beyond what it names."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.modbus.cells import Cell, NumberType
from acquisition.modbus.decoding import MapDecoder
from acquisition.modbus.read_plan import MapError, plan_reads
from acquisition.modbus.register_map import MapValue, RegisterMap, ScaleRegister, Together

SCALE = ScaleRegister(cell=Cell(address=612))


def value(address: int, type_: str = "uint16", **settings) -> MapValue:
    cell = Cell(address=address, type=NumberType(type_))
    return MapValue(id=f"v{address}", cell=cell, **settings)


def requests(values, **settings) -> list[tuple[int, int, int]]:
    plan = plan_reads(RegisterMap(values=tuple(values), **settings))
    return [(r.function, r.address, r.count) for r in plan.spans]


def at(function: int, address: int = 5, **settings) -> MapValue:
    """A value of an address of a function: a bit of coils and discrete inputs, else a register."""
    type_ = NumberType.BIT if function in (1, 2) or "bit" in settings else NumberType.UINT16
    cell = Cell(address=address, function=function, type=type_, **settings)
    return MapValue(id=f"f{function}{settings}", cell=cell)


BLOCK = Together(address=609, count=14)


@pytest.mark.parametrize(
    ("values", "settings", "expected"),
    [
        # neighbours are read together, a gap only where that is allowed
        ([value(0), value(1, "float32"), value(4)], {}, [(3, 0, 3), (3, 4, 1)]),
        ([value(0), value(4)], {"max_gap": 2}, [(3, 0, 1), (3, 4, 1)]),
        ([value(0), value(4)], {"max_gap": 3}, [(3, 0, 5)]),
        # no request is longer than the device allows
        ([value(n) for n in range(130)], {}, [(3, 0, 125), (3, 125, 5)]),
        (
            [value(2 * n, "float32") for n in range(6)],
            {"max_registers": 5},
            [(3, 0, 4), (3, 4, 4), (3, 8, 4)],
        ),
        # a block is read whole if one value of it is used, not at all if none is, and never split
        ([value(612)], {"base": 1, "together": (BLOCK,)}, [(3, 608, 14)]),
        ([value(1)], {"together": (BLOCK,)}, [(3, 1, 1)]),
        (
            [value(n) for n in range(20)],
            {"max_registers": 10, "together": (Together(address=8, count=4),)},
            [(3, 0, 8), (3, 8, 10), (3, 18, 2)],
        ),
        # the same address of another function is another register, two bits of one are in one
        ([at(n) for n in (1, 2, 3, 4)], {}, [(1, 5, 1), (2, 5, 1), (3, 5, 1), (4, 5, 1)]),
        ([at(3, bit=3), at(3, bit=4)], {}, [(3, 5, 1)]),
        # addresses are written as in the manual
        ([value(100)], {"base": 0}, [(3, 100, 1)]),
        ([value(101)], {"base": 1}, [(3, 100, 1)]),
        ([value(40101)], {"base": 40001}, [(3, 100, 1)]),
        ([value(400101)], {"base": 400001}, [(3, 100, 1)]),
    ],
)
def test_a_map_is_read_in_the_fewest_requests_that_are_allowed(values, settings, expected) -> None:
    assert requests(values, **settings) == expected


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

    read = [a for r in plan.spans for a in range(r.address, r.stop)]
    named = {a for v in values for a in range(v.cell.start(0), v.cell.stop(0))}
    assert len(read) == len(set(read))
    assert named <= set(read)
    assert all(r.count <= most for r in plan.spans)
    if gap == 0:
        assert named == set(read)
    for v in values:
        plan.span_of(v.cell)


@pytest.mark.parametrize(
    ("build", "said"),
    [
        (
            lambda: requests([value(9, "float32")], together=(Together(address=10, count=4),)),
            "only a part of the value at register 9",
        ),
        (
            lambda: requests(
                [value(10)], together=(Together(address=10, count=4), Together(address=13, count=4))
            ),
            "contain register 13",
        ),
        (
            lambda: MapDecoder(RegisterMap(values=(value(609, scale_register=SCALE),))),
            "address = 609",
        ),
    ],
)
def test_what_cannot_be_read_together_is_refused_with_the_registers(build, said: str) -> None:
    with pytest.raises(MapError, match=said):
        build()
