"""The framers let reads out and their own replies in."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.framer import FramerRTU
from pymodbus.pdu import ModbusPDU
from pymodbus.pdu.file_message import ReadFifoQueueRequest
from pymodbus.pdu.mei_message import ReadDeviceInformationRequest
from pymodbus.pdu.register_message import ReadHoldingRegistersRequest

from acquisition.modbus.framing import Reply, RtuFramer, TcpFramer

PAYLOAD = bytes(range(10))
REGISTERS = b"\x03\x0a" + PAYLOAD


def tcp_frame(pdu: bytes) -> bytes:
    return bytes([0, 7, 0, 0, 0, len(pdu) + 1, 1]) + pdu


def rtu_frame(pdu: bytes) -> bytes:
    body = b"\1" + pdu
    return body + FramerRTU.compute_CRC(body).to_bytes(2, "big")


WIRES = {"tcp": (TcpFramer, tcp_frame), "rtu": (RtuFramer, rtu_frame)}
on_both_wires = pytest.mark.parametrize(("framer", "frame"), WIRES.values(), ids=WIRES.keys())


def request(kind: type = ReadHoldingRegistersRequest, **asked: int) -> ModbusPDU:
    return kind(dev_id=1, transaction_id=7, **asked)


def received(framer: type, *pieces: bytes) -> Reply | None:
    """Feed pieces as a transport does: what is not used up comes again."""
    judge, buffer, reply = framer(), b"", None
    judge.buildFrame(request(address=100, count=5))
    for piece in pieces:
        buffer += piece
        used, answer = judge.handleFrame(buffer, 1, 7)
        buffer = buffer[used:]
        reply = reply or answer
    return reply


def test_a_read_leaves_as_in_the_specification():
    # the worked example of the Modbus specification, with the checksum of its address and function
    asked = {"address": 0x006B, "count": 3}
    assert RtuFramer().buildFrame(request(**asked)).hex() == "0103006b00037417"
    assert TcpFramer().buildFrame(request(**asked)).hex() == "0007000000060103006b0003"


@on_both_wires
@given(st.lists(st.integers(0, 19), max_size=20))
def test_a_reply_reads_the_same_however_it_is_sliced(framer, frame, cuts):
    right = frame(REGISTERS)
    edges = [0, *sorted(min(cut, len(right)) for cut in cuts), len(right)]
    reply = received(framer, *(right[a:b] for a, b in itertools.pairwise(edges) if b > a))
    assert reply is not None
    assert (reply.pdu[2:], reply.fault) == (PAYLOAD, "")


@on_both_wires
def test_an_exception_reply_is_told_from_registers(framer, frame):
    reply = received(framer, frame(b"\x83\x02"))
    assert reply is not None
    assert (reply.refusal, reply.fault) == (2, "")


@pytest.mark.parametrize(("wire", "n_bytes"), [("tcp", 9), ("rtu", 15)])
@given(data=st.data(), flip=st.integers(1, 255))
def test_no_changed_byte_gets_registers_through(wire, n_bytes, data, flip):
    """Over TCP, none of the head; on a line, none at all."""
    framer, frame = WIRES[wire]
    wrong = bytearray(frame(REGISTERS))
    wrong[data.draw(st.integers(0, n_bytes - 1))] ^= flip
    reply = received(framer, bytes(wrong))
    assert reply is not None or wire == "rtu"
    assert reply is None or (reply.fault and not reply.pdu)


@on_both_wires
@given(st.binary(min_size=1, max_size=400))
def test_no_random_bytes_get_registers_through(framer, frame, data):  # noqa: ARG001
    reply = received(framer, data)
    assert reply is None or (reply.fault and not reply.pdu)


@on_both_wires
@given(st.binary(min_size=1, max_size=20))
def test_bytes_behind_the_reply_spoil_it(framer, frame, extra):
    reply = received(framer, frame(REGISTERS) + extra)
    assert reply is not None
    assert "follow the reply" in reply.fault


def test_bytes_that_nobody_asked_for_are_remembered():
    framer, right = TcpFramer(), tcp_frame(REGISTERS)
    assert framer.handleFrame(right, 0, 0) == (len(right), None)
    assert "unasked" in framer.unasked


VARIABLE = {
    "queue": (ReadFifoQueueRequest, bytes.fromhex("18 0006 0002 01b8 1284")),
    "identification": (
        ReadDeviceInformationRequest,
        bytes.fromhex("2b 0e 01 01 00 00 03") + b"\0\4Acme\1\1D\2\3V10",
    ),
}


of_their_own_length = pytest.mark.parametrize(
    ("kind", "pdu"), VARIABLE.values(), ids=VARIABLE.keys()
)


@on_both_wires
@of_their_own_length
@given(data=st.data())
def test_a_reply_that_tells_its_own_length_is_taken_whole_and_only_then(
    framer, frame, kind, pdu, data
):
    judge, right = framer(), frame(pdu)
    cut = data.draw(st.integers(1, len(right) - 1))
    judge.buildFrame(request(kind))
    assert judge.handleFrame(right[:cut], 1, 0) == (0, None)
    used, reply = judge.handleFrame(right, 1, 0)
    assert (used, reply.pdu, reply.fault) == (len(right), pdu, "")


@on_both_wires
@of_their_own_length
@given(position=st.integers(1, 5), flip=st.integers(1, 255), extra=st.binary(max_size=300))
def test_a_reply_that_tells_its_own_length_wrongly_is_bounded(
    framer, frame, kind, pdu, position, flip, extra
):
    wrong = bytearray(pdu)
    wrong[position] ^= flip
    judge = framer()
    judge.buildFrame(request(kind))
    framed = frame(pdu).replace(pdu, wrong)
    _, reply = judge.handleFrame(framed + bytes(300) + extra, 1, 0)
    assert reply is not None
    assert reply.fault
