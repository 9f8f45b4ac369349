"""Framing lets reads out and their own replies in."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.framer import FramerRTU

from acquisition.errors import ConfigError, FrameError
from acquisition.modbus.framing import PendingRequest, RtuFraming, TcpFraming
from acquisition.modbus.requests import (
    READ_FUNCTIONS,
    ReadRequest,
    Span,
    fifo_request,
    identification_request,
    span_requests,
)

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
def test_a_reply_that_tells_its_own_length_is_taken_whole_and_only_then(
    framing, frame, request_, pdu, data
):
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
