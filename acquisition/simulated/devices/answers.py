"""What a Modbus device answers: from a request's function code and data to those of the reply."""

import struct
from collections.abc import Mapping
from typing import Protocol

_ADDRESS_AND_COUNT = struct.Struct(">HH")
_ADDRESS = struct.Struct(">H")
_ILLEGAL_FUNCTION, _ILLEGAL_ADDRESS, _ILLEGAL_VALUE = 1, 2, 3
_MAX_REGISTERS, _MAX_BITS = 125, 2000
_MEI_READ_IDENTIFICATION = 14
_BASIC_CONFORMITY = 0x81


class ReadableDevice(Protocol):
    """What can be read from a device; nothing can be written."""

    @property
    def identification(self) -> Mapping[int, bytes]:
        """Objects of function 43/14 by their number; none if the device has no such function."""
        ...

    def read_registers(self, function: int, address: int, count: int) -> bytes | None:
        """Big-endian words by function 3 or 4, or None if some of them do not exist."""
        ...

    def read_bits(self, function: int, address: int, count: int) -> bytes | None:
        """Eight bits a byte by function 1 or 2, or None if some of them do not exist."""
        ...

    def read_fifo(self, address: int) -> bytes | None:
        """Registers of a queue, or None if there is no queue."""
        ...


def answer(request: bytes, device: ReadableDevice) -> bytes:
    """Answer a request, with an exception if it asks for anything but what there is to read."""
    function, data = request[0], request[1:]
    match function:
        case 1 | 2 | 3 | 4 if len(data) == _ADDRESS_AND_COUNT.size:
            return _counted(function, data, device)
        case 0x18 if len(data) == _ADDRESS.size:
            return _fifo(data, device)
        case 43 if len(data) == 3 and data[0] == _MEI_READ_IDENTIFICATION and device.identification:
            return _identification(data, device.identification)
    return refusal(function, _ILLEGAL_FUNCTION)


def refusal(function: int, code: int) -> bytes:
    """Exception reply."""
    return bytes((function | 0x80, code))


def _counted(function: int, data: bytes, device: ReadableDevice) -> bytes:
    address, count = _ADDRESS_AND_COUNT.unpack(data)
    of_bits = function in (1, 2)
    if not 1 <= count <= (_MAX_BITS if of_bits else _MAX_REGISTERS):
        return refusal(function, _ILLEGAL_VALUE)
    read = device.read_bits if of_bits else device.read_registers
    values = read(function, address, count)
    if values is None:
        return refusal(function, _ILLEGAL_ADDRESS)
    return bytes((function, len(values))) + values


def _fifo(data: bytes, device: ReadableDevice) -> bytes:
    values = device.read_fifo(_ADDRESS.unpack(data)[0])
    if values is None:
        return refusal(0x18, _ILLEGAL_ADDRESS)
    return struct.pack(">BHH", 0x18, 2 + len(values), len(values) // 2) + values


def _identification(data: bytes, objects: Mapping[int, bytes]) -> bytes:
    asked = {number: value for number, value in sorted(objects.items()) if number >= data[2]}
    body = b"".join(bytes((number, len(value))) + value for number, value in asked.items())
    head = bytes((43, _MEI_READ_IDENTIFICATION, data[1], _BASIC_CONFORMITY, 0, 0, len(asked)))
    return head + body
