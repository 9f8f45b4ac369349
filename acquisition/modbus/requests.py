"""Modbus read requests, and the checks of their replies.

Requests and replies are PDUs: the bytes from the function code on, identical over TCP and RTU.
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
"""Function codes of all requests that can be sent; none of them writes to the device."""

ADDRESS_SPACE = 0x10000
MAX_REGISTERS_PER_READ = 125
MAX_FIFO_REGISTERS = 31
"""Maximum length of a readable FIFO queue (Modbus Application Protocol 1.1b3, 6.18)."""

MAX_PDU_BYTES = 253
EXCEPTION_BIT = 0x80
BUSY = 6
"""Exception code of a busy device: repeat the request later (MODBUS V1.1b3, section 7)."""

_EXCEPTIONS = {
    1: "illegal function",
    2: "illegal data address",
    3: "illegal data value",
    4: "server device failure",
    5: "acknowledge",
    BUSY: "server device busy",
    8: "memory parity error",
    10: "gateway path unavailable",
    11: "gateway target device failed to respond",
}
_CONFIG_EXCEPTIONS = (1, 2, 3)

_MAX_BITS_PER_READ = 2000
_EXCEPTION_BYTES = 2
_READ_BASIC = bytes((0x0E, 1))
"""MEI type and read code of a request for the basic identification."""

_IDENTIFICATION_HEAD = struct.Struct(">7B")
FIFO_HEAD = struct.Struct(">BHH")
"""Function code, byte count and number of registers of a FIFO reply, before the registers."""

_SPAN_REQUEST = struct.Struct(">BHH")


@dataclass(frozen=True, slots=True)
class Span:
    """Range of consecutive registers or bits of a device.

    Parameters
    ----------
    address
        Address of the first register or bit, counted from 0 as on the wire.
    count
        Number of registers, or of bits for functions 1 and 2.
    function
        1 (coils), 2 (discrete inputs), 3 (holding registers) or 4 (input registers).

    Raises
    ------
    ConfigError
        If the function or the address range is invalid.
    """

    address: int
    count: int
    function: int = READ_HOLDING_REGISTERS

    def __post_init__(self) -> None:
        if self.function not in SPAN_FUNCTIONS:
            raise ConfigError(f"Modbus function must be 1, 2, 3 or 4, got {self.function}")
        if not 0 <= self.address < self.stop <= ADDRESS_SPACE:
            raise ConfigError(
                f"a Modbus request must be of at least 1 address from 0 to {ADDRESS_SPACE - 1}, got"
                f" {self.count} addresses from {self.address} on"
            )

    @property
    def stop(self) -> int:
        """Address after the last address of the span."""
        return self.address + self.count

    @property
    def n_bytes(self) -> int:
        """Length of the content in bytes: two per register, one per eight bits."""
        return -(-self.count // 8) if self.function in BIT_FUNCTIONS else 2 * self.count


@dataclass(frozen=True)
class ReadRequest:
    """Modbus read request, given by its PDU.

    Raises ConfigError if the PDU is not a read request; only read requests can be framed.
    """

    pdu: bytes

    def __post_init__(self) -> None:
        function = self.pdu[0]
        # function 43 also has other services
        is_other_service = function == READ_IDENTIFICATION and self.pdu[1:3] != _READ_BASIC
        if function not in READ_FUNCTIONS or is_other_service:
            raise ConfigError(
                f"Modbus function must be one of {READ_FUNCTIONS}, which only read, got {function}"
            )

    def __str__(self) -> str:
        """Description of the request; example: "a read of 2 at 100, function 3"."""
        match self.pdu[0]:
            case 0x18:
                return f"a read of the FIFO queue at {int.from_bytes(self.pdu[1:3], 'big')}"
            case 43:
                return "a read of the device identification"
        function, address, count = _SPAN_REQUEST.unpack(self.pdu)
        return f"a read of {count} at {address}, function {function}"

    def min_bytes(self, reply: memoryview) -> int:
        """Return the minimum length of the reply in bytes, given the bytes received so far.

        Parameters
        ----------
        reply
            Received bytes, from the function code on; at least the function code.

        Raises
        ------
        FrameError
            If the bytes are the start of neither a valid reply nor an exception.
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
        count = self.pdu[-2] << 8 | self.pdu[-1]
        n_bytes = 2 * count if function in REGISTER_FUNCTIONS else -(-count // 8)
        if len(reply) > 1 and reply[1] != n_bytes:
            raise FrameError(f"byte count is {reply[1]}, expected {n_bytes}")
        return 2 + n_bytes


def _fifo_bytes(reply: memoryview) -> int:
    """Return the length of a FIFO reply in bytes; that of its head while the head is incomplete."""
    if len(reply) < FIFO_HEAD.size:
        return FIFO_HEAD.size
    n_bytes: int
    n_registers: int
    _, n_bytes, n_registers = FIFO_HEAD.unpack_from(reply)
    if n_registers > MAX_FIFO_REGISTERS:
        raise FrameError(f"FIFO count must be 0 to {MAX_FIFO_REGISTERS}, got {n_registers}")
    if n_bytes != 2 + 2 * n_registers:
        raise FrameError(
            f"byte count is {n_bytes}, expected {2 + 2 * n_registers} for FIFO count {n_registers}"
        )
    return FIFO_HEAD.size + 2 * n_registers


def _identification_bytes(reply: memoryview, expected: bytes) -> int:
    """Return the minimum length of an identification reply in bytes, given its first bytes."""
    found = bytes(reply[1:3])
    if not expected.startswith(found):
        raise FrameError(f"MEI type and read code are {found.hex()}, expected {expected.hex()}")
    end = _IDENTIFICATION_HEAD.size
    if len(reply) < end:
        return end
    for _ in range(reply[6]):
        if len(reply) < end + 2:
            end += 2
            break
        end += 2 + reply[end + 1]
    if end > MAX_PDU_BYTES:
        raise FrameError(f"identification is longer than {MAX_PDU_BYTES} bytes")
    return end


@lru_cache(maxsize=1024)  # the same spans are read in every poll
def span_requests(span: Span) -> tuple[ReadRequest, ...]:
    """Return the requests that read a range of registers or bits, in address order."""
    step = _MAX_BITS_PER_READ if span.function in BIT_FUNCTIONS else MAX_REGISTERS_PER_READ
    return tuple(
        ReadRequest(_SPAN_REQUEST.pack(span.function, at, min(step, span.stop - at)))
        for at in range(span.address, span.stop, step)
    )


def fifo_request(address: int) -> ReadRequest:
    """Return the request that reads the FIFO queue at an address (function 0x18).

    Raises ConfigError if the address is not 0 to 65535.
    """
    pointer = Span(address, 1)
    return ReadRequest(bytes((READ_FIFO_QUEUE,)) + pointer.address.to_bytes(2, "big"))


def identification_request(first_object: int = 0) -> ReadRequest:
    """Return the request for the basic identification (43/14) from object `first_object` on."""
    return ReadRequest(bytes((READ_IDENTIFICATION, *_READ_BASIC, first_object)))


def identification_objects(reply: bytes) -> tuple[dict[int, bytes], int | None]:
    """Return the objects in an identification reply by number, and the next object to request.

    The next object is None if the identification is complete.
    """
    _, _, _, _, more_follows, next_object, n_objects = _IDENTIFICATION_HEAD.unpack_from(reply)
    objects, at = {}, _IDENTIFICATION_HEAD.size
    for _ in range(n_objects):
        number, n_bytes = reply[at], reply[at + 1]
        objects[number] = reply[at + 2 : at + 2 + n_bytes]
        at += 2 + n_bytes
    return objects, next_object if more_follows else None


def exception_error(where: str, code: int, request: ReadRequest) -> AcquisitionError:
    """Return the error for an exception reply: ConfigError if the request can never succeed.

    Otherwise LinkError; `where` is the address of the device in the message.
    """
    kind = ConfigError if code in _CONFIG_EXCEPTIONS else LinkError
    name = _EXCEPTIONS.get(code, "unknown")
    return kind(f"{where}: device returned exception {code} ({name}) for {request}")
