"""A map is read in the fewest requests, and each request and reply is a frame as specified."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.framer import FramerRTU

from acquisition.errors import ConfigError, FrameError
from acquisition.modbus.cells import Cell, NumberType
from acquisition.modbus.decoding import MapDecoder
from acquisition.modbus.framing import PendingRequest, RtuFraming, TcpFraming
from acquisition.modbus.read_plan import MapError, plan_reads
from acquisition.modbus.register_map import MapValue, RegisterMap, ScaleRegister, Together
from acquisition.modbus.requests import (
    READ_FUNCTIONS,
    ReadRequest,
    Span,
    fifo_request,
    identification_request,
    span_requests,
)

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
def test_a_map_is_read_in_the_fewest_requests_that_are_allowed(values, settings, expected):
    assert requests(values, **settings) == expected


@given(
    st.lists(st.tuples(st.integers(0, 6), st.sampled_from(["uint16", "float32", "float64"]))),
    st.integers(4, 125),
    st.integers(0, 8),
)
def test_every_cell_is_in_one_request_and_every_request_holds_cells(layout, most, gap):
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
def test_what_cannot_be_read_together_is_refused_with_the_registers(build, said):
    with pytest.raises(MapError, match=said):
        build()


REGISTERS = b"\x03\x0a" + bytes(range(10))


def tcp_frame(pdu: bytes) -> bytes:
    return bytes([0, 7, 0, 0, 0, len(pdu) + 1, 1]) + pdu


def rtu_frame(pdu: bytes) -> bytes:
    body = b"\1" + pdu
    return body + FramerRTU.compute_CRC(body).to_bytes(2, "big")


WIRES = {"tcp": (TcpFraming(), tcp_frame), "rtu": (RtuFraming(), rtu_frame)}
on_both_wires = pytest.mark.parametrize(("framing", "frame"), WIRES.values(), ids=WIRES.keys())


def asked(request: ReadRequest | None = None) -> PendingRequest:
    return PendingRequest(request or span_requests(Span(100, 5))[0], unit=1, transaction=7)


def reply(framing, data: bytes, request: ReadRequest | None = None) -> bytes | None:
    """The reply if these bytes begin with the right one, None if they may become it."""
    found = framing.take(memoryview(data), asked(request))
    return None if found is None else bytes(found[1])


def believed(framing, data: bytes, request: ReadRequest | None = None) -> bytes | None:
    """As `reply`; None too if they can never become the right one."""
    try:
        return reply(framing, data, request)
    except FrameError:
        return None


def test_a_read_leaves_as_in_the_specification():
    # the worked example of the Modbus specification, with the checksum of its address and function
    example = asked(*span_requests(Span(0x006B, 3)))
    assert RtuFraming().frame(example).hex() == "0103006b00037417"
    assert TcpFraming().frame(example).hex() == "0007000000060103006b0003"


@pytest.mark.parametrize("function", range(256))
def test_only_functions_that_read_can_be_formed(function):
    if function in READ_FUNCTIONS and function != 43:
        ReadRequest(bytes([function]) + b"\0\0\0\1")
        return
    for body in (b"\0\0\0\1", b"\x0d\x01\x00", b"\x0e\x00\x00", b"\x0e\x05\x00", b""):
        with pytest.raises(ConfigError, match=f"which only read, got {function}"):
            ReadRequest(bytes([function]) + body)


@on_both_wires
@given(cut=st.integers(0, 18), extra=st.binary(max_size=20))
def test_a_reply_is_taken_whole_and_only_then(framing, frame, cut, extra):
    right = frame(REGISTERS)
    assert reply(framing, right[: min(cut, len(right) - 1)]) is None
    assert framing.take(memoryview(right + extra), asked()) == (len(right), REGISTERS)


@on_both_wires
def test_an_exception_reply_is_told_from_registers(framing, frame):
    assert reply(framing, frame(b"\x83\x02")) == b"\x83\x02"


@pytest.mark.parametrize(("wire", "n_bytes"), [("tcp", 9), ("rtu", 15)])
@given(data=st.data(), flip=st.integers(1, 255))
def test_no_changed_byte_gets_registers_through(wire, n_bytes, data, flip):
    """Over TCP, none of the head; on a line, none at all."""
    framing, frame = WIRES[wire]
    wrong = bytearray(frame(REGISTERS))
    wrong[data.draw(st.integers(0, n_bytes - 1))] ^= flip
    assert believed(framing, bytes(wrong)) is None


@on_both_wires
@given(st.binary(min_size=1, max_size=400))
def test_no_random_bytes_get_registers_through(framing, frame, data):  # noqa: ARG001
    assert believed(framing, data) is None


VARIABLE = {
    "queue": (fifo_request(7), bytes.fromhex("18 0006 0002 01b8 1284")),
    "identification": (
        identification_request(),
        bytes.fromhex("2b 0e 01 01 00 00 03") + b"\0\4Acme\1\1D\2\3V10",
    ),
}


of_their_own_length = pytest.mark.parametrize(
    ("request_", "pdu"), VARIABLE.values(), ids=VARIABLE.keys()
)


@on_both_wires
@of_their_own_length
@given(data=st.data())
def test_a_reply_that_tells_its_length_is_taken_only_whole(framing, frame, request_, pdu, data):
    right = frame(pdu)
    cut = data.draw(st.integers(1, len(right) - 1))
    assert reply(framing, right[:cut], request_) is None
    assert reply(framing, right, request_) == pdu


@on_both_wires
@of_their_own_length
@given(position=st.integers(1, 5), flip=st.integers(1, 255), extra=st.binary(max_size=300))
def test_a_reply_that_tells_its_own_length_wrongly_is_bounded(
    framing, frame, request_, pdu, position, flip, extra
):
    wrong = bytearray(pdu)
    wrong[position] ^= flip
    found = believed(framing, frame(pdu).replace(pdu, wrong) + bytes(300) + extra, request_)
    # without a checksum, what neither counts nor identifies may be anything
    assert found is None or (frame is tcp_frame and len(found) == len(pdu))
