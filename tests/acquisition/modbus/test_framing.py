"""The framer lets reads out and their own replies in."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.pdu.register_message import ReadHoldingRegistersRequest, WriteSingleRegisterRequest

from acquisition.errors import ConfigError
from acquisition.modbus.framing import Reply, TcpFramer

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


def test_a_write_never_leaves():
    with pytest.raises(ConfigError, match="function code 6 is never sent"):
        TcpFramer().buildFrame(WriteSingleRegisterRequest(address=1, registers=[1]))


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
