"""The framers let reads out and their own replies in."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.framer import FramerRTU
from pymodbus.pdu.file_message import ReadFifoQueueRequest
from pymodbus.pdu.mei_message import ReadDeviceInformationRequest
from pymodbus.pdu.register_message import ReadHoldingRegistersRequest

from acquisition.modbus.framing import Reply, RtuFramer, TcpFramer

PAYLOAD = bytes(range(10))
RIGHT = bytes.fromhex("00070000000d01030a") + PAYLOAD
EXCEPTION = bytes.fromhex("00070000000301") + b"\x83\x02"


def asked() -> TcpFramer:
    framer = TcpFramer()
    framer.buildFrame(ReadHoldingRegistersRequest(dev_id=1, transaction_id=7, address=100, count=5))
    return framer


def received(*pieces: bytes) -> Reply | None:
    """Feed pieces as a transport does: what is not used up comes again."""
    framer, buffer, reply = asked(), b"", None
    for piece in pieces:
        buffer += piece
        used, answer = framer.handleFrame(buffer, 1, 7)
        buffer = buffer[used:]
        reply = reply or answer
    return reply


def test_a_read_leaves_as_twelve_bytes():
    framer = TcpFramer()
    request = ReadHoldingRegistersRequest(dev_id=1, transaction_id=7, address=100, count=5)
    assert framer.buildFrame(request).hex() == "000700000006010300640005"


@given(st.lists(st.integers(0, len(RIGHT)), max_size=20))
def test_a_reply_reads_the_same_however_it_is_sliced(cuts):
    edges = [0, *sorted(cuts), len(RIGHT)]
    pieces = [RIGHT[a:b] for a, b in itertools.pairwise(edges) if b > a]
    reply = received(*pieces)
    assert reply is not None
    assert reply.pdu[2:] == PAYLOAD
    assert not reply.fault


def test_an_exception_reply_is_told_from_registers():
    reply = received(EXCEPTION)
    assert reply is not None
    assert (reply.refusal, reply.fault) == (2, "")


@given(position=st.integers(0, 8), flip=st.integers(1, 255))
def test_no_changed_byte_of_the_head_gets_registers_through(position, flip):
    wrong = bytearray(RIGHT)
    wrong[position] ^= flip
    reply = received(bytes(wrong))
    assert reply is not None
    assert reply.fault
    assert not reply.pdu


@given(st.binary(min_size=1, max_size=400))
def test_no_random_bytes_get_registers_through(data):
    reply = received(data)
    assert reply is None or reply.fault
    assert reply is None or not reply.pdu


@given(st.binary(min_size=1, max_size=20))
def test_bytes_behind_the_reply_spoil_it(extra):
    reply = received(RIGHT + extra)
    assert reply is not None
    assert "follow the reply" in reply.fault


def test_bytes_that_nobody_asked_for_are_remembered():
    framer = TcpFramer()
    assert framer.handleFrame(RIGHT, 0, 0) == (len(RIGHT), None)
    assert "unasked" in framer.unasked


def rtu_frame(pdu: bytes, unit: int = 1) -> bytes:
    body = bytes([unit]) + pdu
    return body + FramerRTU.compute_CRC(body).to_bytes(2, "big")


RTU_RIGHT = rtu_frame(b"\x03\x0a" + PAYLOAD)
RTU_EXCEPTION = rtu_frame(b"\x83\x02")


def received_on_line(*pieces: bytes) -> Reply | None:
    framer, buffer, reply = RtuFramer(), b"", None
    framer.buildFrame(ReadHoldingRegistersRequest(dev_id=1, address=100, count=5))
    for piece in pieces:
        buffer += piece
        used, answer = framer.handleFrame(buffer, 1, 0)
        buffer = buffer[used:]
        reply = reply or answer
    return reply


def test_a_read_leaves_on_a_line_with_its_checksum():
    request = ReadHoldingRegistersRequest(dev_id=1, address=0x006B, count=3)
    # the worked example of the Modbus specification, with the checksum of its address and function
    assert RtuFramer().buildFrame(request).hex() == "0103006b00037417"


@given(st.lists(st.integers(0, len(RTU_RIGHT)), max_size=20))
def test_a_reply_on_a_line_reads_the_same_however_it_is_sliced(cuts):
    edges = [0, *sorted(cuts), len(RTU_RIGHT)]
    pieces = [RTU_RIGHT[a:b] for a, b in itertools.pairwise(edges) if b > a]
    reply = received_on_line(*pieces)
    assert reply is not None
    assert (reply.pdu[2:], reply.fault) == (PAYLOAD, "")


def test_an_exception_on_a_line_is_told_from_registers():
    reply = received_on_line(RTU_EXCEPTION)
    assert reply is not None
    assert (reply.refusal, reply.fault) == (2, "")


@given(position=st.integers(0, len(RTU_RIGHT) - 1), flip=st.integers(1, 255))
def test_no_changed_byte_on_a_line_gets_registers_through(position, flip):
    wrong = bytearray(RTU_RIGHT)
    wrong[position] ^= flip
    reply = received_on_line(bytes(wrong))
    assert reply is None or (reply.fault and not reply.pdu)


@given(extra=st.binary(min_size=1, max_size=20))
def test_bytes_behind_a_reply_on_a_line_spoil_it(extra):
    reply = received_on_line(RTU_RIGHT + extra)
    assert reply is not None
    assert "follow the reply" in reply.fault


VARIABLE = {
    "queue": (ReadFifoQueueRequest, bytes.fromhex("18 0006 0002 01b8 1284")),
    "identification": (
        ReadDeviceInformationRequest,
        bytes.fromhex("2b 0e 01 01 00 00 03") + b"\0\4Acme\1\1D\2\3V10",
    ),
}


@pytest.mark.parametrize(("request_kind", "pdu"), VARIABLE.values(), ids=VARIABLE.keys())
@given(data=st.data())
def test_a_reply_that_tells_its_own_length_is_taken_whole_and_only_then(request_kind, pdu, data):
    for framer, frame in (
        (TcpFramer(), bytes([0, 0, 0, 0, 0, len(pdu) + 1, 1]) + pdu),
        (RtuFramer(), rtu_frame(pdu)),
    ):
        cut = data.draw(st.integers(1, len(frame) - 1))
        framer.buildFrame(request_kind(dev_id=1))
        assert framer.handleFrame(frame[:cut], 1, 0) == (0, None)
        used, reply = framer.handleFrame(frame, 1, 0)
        assert (used, reply.pdu, reply.fault) == (len(frame), pdu, "")


@pytest.mark.parametrize(("request_kind", "pdu"), VARIABLE.values(), ids=VARIABLE.keys())
@given(position=st.integers(0, 12), flip=st.integers(1, 255), extra=st.binary(max_size=300))
def test_a_reply_that_tells_its_own_length_wrongly_is_bounded(
    request_kind, pdu, position, flip, extra
):
    wrong = bytearray(pdu)
    wrong[position % 5 + 1] ^= flip
    for framer, frame in (
        (TcpFramer(), bytes([0, 0, 0, 0, 0, len(pdu) + 1, 1]) + wrong),
        (RtuFramer(), rtu_frame(pdu)[:1] + wrong + rtu_frame(pdu)[-2:]),
    ):
        framer.buildFrame(request_kind(dev_id=1))
        _, reply = framer.handleFrame(frame + bytes(300) + extra, 1, 0)
        assert reply is not None
        assert reply.fault
