"""Requests that only read, and for each of them how its answer must look.

A reply is judged by its function code and what follows it (the PDU), the same over TCP and RTU.
"""

import struct
from dataclasses import dataclass
from typing import Protocol

from acquisition.errors import ConfigError, FrameError

READ_COILS = 1
READ_DISCRETE_INPUTS = 2
READ_HOLDING_REGISTERS = 3
READ_INPUT_REGISTERS = 4
READ_FIFO_QUEUE = 0x18
READ_IDENTIFICATION = 43
READ_FUNCTIONS = (
    READ_COILS,
    READ_DISCRETE_INPUTS,
    READ_HOLDING_REGISTERS,
    READ_INPUT_REGISTERS,
    READ_FIFO_QUEUE,
    READ_IDENTIFICATION,
)
"""The only function codes that can leave this process."""

MAX_PDU_BYTES = 253
MAX_FIFO_REGISTERS = 31
EXCEPTION_BIT = 0x80
_EXCEPTION_BYTES = 2
_MEI = b"\x0e"
READ_BASIC = 1
_READ_CODES = (READ_BASIC, 2, 3, 4)
_IDENTIFICATION_HEAD = struct.Struct(">7B")
_FIFO_HEAD = struct.Struct(">BHH")
_ADDRESS_AND_COUNT = struct.Struct(">HH")


class ReplyShape(Protocol):
    """The reply that one outstanding request allows, apart from an exception."""

    def least_bytes(self, pdu: memoryview) -> int:
        """Bytes that the whole reply has, or at least has, by what has arrived of it.

        Raises
        ------
        FrameError
            If what has arrived can never become the right reply.
        """
        ...


@dataclass(frozen=True)
class CountedReply:
    """Registers or bits: so many bytes, known from the request."""

    n_bytes: int

    def least_bytes(self, pdu: memoryview) -> int:
        """Length of the reply, which is known in advance."""
        if len(pdu) > 1 and pdu[1] != self.n_bytes:
            raise FrameError(f"byte count is {pdu[1]}, expected {self.n_bytes}")
        return 2 + self.n_bytes


@dataclass(frozen=True)
class FifoReply:
    """A queue's registers: the reply says how many, at most 31."""

    def least_bytes(self, pdu: memoryview) -> int:
        """Length of the reply by its FIFO count."""
        if len(pdu) < _FIFO_HEAD.size:
            return _FIFO_HEAD.size
        n_bytes: int
        n_registers: int
        _, n_bytes, n_registers = _FIFO_HEAD.unpack_from(pdu)
        if n_registers > MAX_FIFO_REGISTERS:
            raise FrameError(f"FIFO count is {n_registers}, allowed is 0 to {MAX_FIFO_REGISTERS}")
        if n_bytes != 2 + 2 * n_registers:
            raise FrameError(f"byte count is {n_bytes} with a FIFO count of {n_registers}")
        return _FIFO_HEAD.size + 2 * n_registers


@dataclass(frozen=True)
class IdentificationReply:
    """Objects of a device's identification, each with its own length."""

    read_code: int

    def least_bytes(self, pdu: memoryview) -> int:
        """Length of the reply, as far as its objects are known."""
        expected, found = _MEI + bytes((self.read_code,)), bytes(pdu[1:3])
        if not expected.startswith(found):
            raise FrameError(f"MEI type and read code are {found.hex()}, not {expected.hex()}")
        if len(pdu) < _IDENTIFICATION_HEAD.size:
            return _IDENTIFICATION_HEAD.size
        end = _IDENTIFICATION_HEAD.size
        for _ in range(pdu[6]):
            if len(pdu) < end + 2:
                end += 2
                break
            end += 2 + pdu[end + 1]
        if end > MAX_PDU_BYTES:
            raise FrameError(f"identification of more than {MAX_PDU_BYTES} bytes")
        return end


@dataclass(frozen=True)
class ReadRequest:
    """One request, and the reply that it allows.

    Parameters
    ----------
    function, body
        Function code, and what follows it.
    shape
        Of the reply, apart from an exception.
    intent
        What is asked for, in the words of the error if the device refuses; example: "a read of 2
        at 100".

    Raises
    ------
    ConfigError
        If it is not one that only reads. Nothing else can be framed.
    """

    function: int
    body: bytes
    shape: ReplyShape
    intent: str

    def __post_init__(self) -> None:
        is_read = self.function in READ_FUNCTIONS
        if self.function == READ_IDENTIFICATION:
            # function 43 carries other services too
            is_read = self.body[:1] == _MEI and self.body[1] in _READ_CODES
        if not is_read:
            raise ConfigError(
                f"function code {self.function} is never sent, only {READ_FUNCTIONS} to read"
            )

    @property
    def pdu(self) -> bytes:
        """The request from its function code on."""
        return bytes((self.function,)) + self.body

    def least_bytes(self, pdu: memoryview) -> int:
        """Bytes that the reply has or at least has: the one asked for, or an exception.

        Raises
        ------
        FrameError
            If it can never become either.
        """
        if pdu[0] == self.function:
            return self.shape.least_bytes(pdu)
        if pdu[0] == self.function | EXCEPTION_BIT:
            return _EXCEPTION_BYTES
        raise FrameError(f"function code is {pdu[0]}, expected {self.function}")


def registers_request(address: int, count: int, function: int) -> ReadRequest:
    """Registers by function 3 or 4."""
    intent = f"a read of {count} at {address}, function {function}"
    body = _ADDRESS_AND_COUNT.pack(address, count)
    return ReadRequest(function, body, CountedReply(2 * count), intent)


def bits_request(address: int, count: int, function: int) -> ReadRequest:
    """Bits by function 1 or 2."""
    intent = f"a read of {count} at {address}, function {function}"
    body = _ADDRESS_AND_COUNT.pack(address, count)
    return ReadRequest(function, body, CountedReply(-(-count // 8)), intent)


def fifo_request(address: int) -> ReadRequest:
    """A queue, by function 0x18."""
    body = address.to_bytes(2, "big")
    return ReadRequest(READ_FIFO_QUEUE, body, FifoReply(), f"a read of the queue at {address}")


def identification_request(first_object: int = 0) -> ReadRequest:
    """The basic objects of function 43/14, from one of them on."""
    body = _MEI + bytes((READ_BASIC, first_object))
    shape = IdentificationReply(READ_BASIC)
    return ReadRequest(READ_IDENTIFICATION, body, shape, "a read of its identification")


def fifo_registers(pdu: bytes) -> bytes:
    """Registers of a FIFO reply, big-endian words."""
    return pdu[_FIFO_HEAD.size :]


def identification_objects(pdu: bytes) -> tuple[dict[int, bytes], int | None]:
    """Objects of an identification reply by their number, and where to go on asking, if so."""
    _, _, _, _, more_follows, next_object, n_objects = _IDENTIFICATION_HEAD.unpack_from(pdu)
    objects, at = {}, _IDENTIFICATION_HEAD.size
    for _ in range(n_objects):
        number, n_bytes = pdu[at], pdu[at + 1]
        objects[number] = pdu[at + 2 : at + 2 + n_bytes]
        at += 2 + n_bytes
    return objects, next_object if more_follows else None
