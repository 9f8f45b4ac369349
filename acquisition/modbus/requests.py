"""Requests that only read, and the reply that each of them allows.

Requests and replies are taken from their function code on (the PDU), the same over TCP and RTU.
"""

import struct
from dataclasses import dataclass
from functools import lru_cache

from acquisition.errors import AcquisitionError, ConfigError, FrameError, LinkError

READ_COILS = 1
READ_DISCRETE_INPUTS = 2
READ_HOLDING_REGISTERS = 3
READ_INPUT_REGISTERS = 4
READ_FIFO_QUEUE = 0x18
READ_IDENTIFICATION = 43
BIT_FUNCTIONS = (READ_COILS, READ_DISCRETE_INPUTS)
REGISTER_FUNCTIONS = (READ_HOLDING_REGISTERS, READ_INPUT_REGISTERS)
SPAN_FUNCTIONS = (*BIT_FUNCTIONS, *REGISTER_FUNCTIONS)
READ_FUNCTIONS = (*SPAN_FUNCTIONS, READ_FIFO_QUEUE, READ_IDENTIFICATION)
"""The only function codes that can leave this process."""

ADDRESS_SPACE = 0x10000
MAX_REGISTERS_PER_READ = 125
MAX_FIFO_REGISTERS = 31
"""Modbus Application Protocol 1.1b3, 6.18: a longer queue cannot be read."""

MAX_PDU_BYTES = 253
EXCEPTION_BIT = 0x80
BUSY = 6
"""The device could not take the request, and asks for it again later (MODBUS V1.1b3, section 7)."""

_EXCEPTIONS = {
    1: "illegal function",
    2: "illegal address",
    3: "illegal value",
    4: "device failure",
    5: "acknowledge",
    BUSY: "busy",
    8: "memory parity error",
    10: "gateway path unavailable",
    11: "gateway target does not answer",
}
_CONFIG_EXCEPTIONS = (1, 2, 3)

_MAX_BITS_PER_READ = 2000
_EXCEPTION_BYTES = 2
_MEI = 0x0E
_READ_BASIC = 1
_READ_CODES = (_READ_BASIC, 2, 3, 4)
_IDENTIFICATION_HEAD = struct.Struct(">7B")
_FIFO_HEAD = struct.Struct(">BHH")
_SPAN_REQUEST = struct.Struct(">BHH")


@dataclass(frozen=True, slots=True)
class Span:
    """Consecutive registers, or bits, of a device.

    Parameters
    ----------
    address
        Of the first one, counted from 0 as on the wire.
    count
        Registers, or bits of functions 1 and 2.
    function
        1 (coils), 2 (discrete inputs), 3 (holding registers) or 4 (input registers).

    Raises
    ------
    ConfigError
        If no device can have them.
    """

    address: int
    count: int
    function: int = READ_HOLDING_REGISTERS

    def __post_init__(self) -> None:
        if self.function not in SPAN_FUNCTIONS:
            raise ConfigError(f"modbus: function is {self.function}, allowed are 1, 2, 3 and 4")
        if not 0 <= self.address < self.stop <= ADDRESS_SPACE:
            raise ConfigError(
                f"modbus: {self.count} at {self.address} are asked, addresses are 0 to"
                f" {ADDRESS_SPACE - 1}"
            )

    @property
    def stop(self) -> int:
        """First address after it."""
        return self.address + self.count

    @property
    def n_bytes(self) -> int:
        """Bytes of its content: two for each register, one for each eight bits."""
        return -(-self.count // 8) if self.function in BIT_FUNCTIONS else 2 * self.count


@dataclass(frozen=True, slots=True)
class ReadRequest:
    """One request: its bytes from the function code on.

    Raises
    ------
    ConfigError
        If it does not only read. Nothing else can be framed.
    """

    pdu: bytes

    def __post_init__(self) -> None:
        function = self.pdu[0]
        # function 43 carries other services too
        is_other_service = function == READ_IDENTIFICATION and (
            len(self.pdu) < 3 or self.pdu[1] != _MEI or self.pdu[2] not in _READ_CODES
        )
        if function not in READ_FUNCTIONS or is_other_service:
            raise ConfigError(
                f"function code {function} is never sent, only {READ_FUNCTIONS} to read"
            )

    def __str__(self) -> str:
        """Description of the request; example: "a read of 2 at 100, function 3"."""
        match self.pdu[0]:
            case 0x18:
                return f"a read of the queue at {int.from_bytes(self.pdu[1:3], 'big')}"
            case 43:
                return "a read of its identification"
        function, address, count = _SPAN_REQUEST.unpack(self.pdu)
        return f"a read of {count} at {address}, function {function}"

    def min_bytes(self, reply: memoryview) -> int:
        """Bytes that the reply has, or has at least, by what has arrived of it.

        Parameters
        ----------
        reply
            What has arrived, from the function code on; at least that.

        Raises
        ------
        FrameError
            If what has arrived can become neither the right reply nor an exception.
        """
        function, found = self.pdu[0], reply[0]
        if found != function:
            if found == function | EXCEPTION_BIT:
                return _EXCEPTION_BYTES
            raise FrameError(f"function code is {found}, expected {function}")
        if function == READ_FIFO_QUEUE:
            return _fifo_bytes(reply)
        if function == READ_IDENTIFICATION:
            return _identification_bytes(reply, self.pdu[1:3])
        count = self.pdu[3] << 8 | self.pdu[4]
        n_bytes = 2 * count if function in REGISTER_FUNCTIONS else -(-count // 8)
        if len(reply) > 1 and reply[1] != n_bytes:
            raise FrameError(f"byte count is {reply[1]}, expected {n_bytes}")
        return 2 + n_bytes


def _fifo_bytes(reply: memoryview) -> int:
    """Length of a queue's reply, which states how many registers follow."""
    if len(reply) < _FIFO_HEAD.size:
        return _FIFO_HEAD.size
    n_bytes: int
    n_registers: int
    _, n_bytes, n_registers = _FIFO_HEAD.unpack_from(reply)
    if n_registers > MAX_FIFO_REGISTERS:
        raise FrameError(f"FIFO count is {n_registers}, allowed is 0 to {MAX_FIFO_REGISTERS}")
    if n_bytes != 2 + 2 * n_registers:
        raise FrameError(f"byte count is {n_bytes} with a FIFO count of {n_registers}")
    return _FIFO_HEAD.size + 2 * n_registers


def _identification_bytes(reply: memoryview, expected: bytes) -> int:
    """Length of an identification, as far as its objects are known; each states its own."""
    found = bytes(reply[1:3])
    if not expected.startswith(found):
        raise FrameError(f"MEI type and read code are {found.hex()}, not {expected.hex()}")
    end = _IDENTIFICATION_HEAD.size
    if len(reply) < end:
        return end
    for _ in range(reply[6]):
        if len(reply) < end + 2:
            end += 2
            break
        end += 2 + reply[end + 1]
    if end > MAX_PDU_BYTES:
        raise FrameError(f"identification of more than {MAX_PDU_BYTES} bytes")
    return end


@lru_cache(maxsize=1024)  # the spans of a device are read again in every poll
def span_requests(span: Span) -> tuple[ReadRequest, ...]:
    """Requests that read a span, in the order of their addresses."""
    step = _MAX_BITS_PER_READ if span.function in BIT_FUNCTIONS else MAX_REGISTERS_PER_READ
    return tuple(
        ReadRequest(_SPAN_REQUEST.pack(span.function, at, min(step, span.stop - at)))
        for at in range(span.address, span.stop, step)
    )


def fifo_request(address: int) -> ReadRequest:
    """Request for a queue, by function 0x18.

    Raises
    ------
    ConfigError
        If there is no such address.
    """
    pointer = Span(address, 1)
    return ReadRequest(bytes((READ_FIFO_QUEUE,)) + pointer.address.to_bytes(2, "big"))


def identification_request(first_object: int = 0) -> ReadRequest:
    """Request for the basic objects of function 43/14, from one of them on."""
    return ReadRequest(bytes((READ_IDENTIFICATION, _MEI, _READ_BASIC, first_object)))


def fifo_registers(reply: memoryview) -> bytes:
    """Registers of a FIFO reply, big-endian words."""
    return bytes(reply[_FIFO_HEAD.size :])


def identification_objects(reply: memoryview) -> tuple[dict[int, bytes], int | None]:
    """Objects of an identification by their number, and the next one to ask for, if any."""
    _, _, _, _, more_follows, next_object, n_objects = _IDENTIFICATION_HEAD.unpack_from(reply)
    objects, at = {}, _IDENTIFICATION_HEAD.size
    for _ in range(n_objects):
        number, n_bytes = reply[at], reply[at + 1]
        objects[number] = bytes(reply[at + 2 : at + 2 + n_bytes])
        at += 2 + n_bytes
    return objects, next_object if more_follows else None


def exception_error(where: str, code: int, request: ReadRequest) -> AcquisitionError:
    """Error that an exception code stands for: LinkError if asking again later can help."""
    kind = ConfigError if code in _CONFIG_EXCEPTIONS else LinkError
    name = _EXCEPTIONS.get(code, "unknown")
    return kind(f"{where}: device answers exception {code} ({name}) to {request}")
