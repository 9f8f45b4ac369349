"""Framing, TCP and RTU: a request as bytes, and the one reply that it allows out of bytes.

The answer to a read is known in advance but for the values; whatever differs is a fault. Judging
stops at the first fault: what follows one cannot be told apart from it.
"""

import struct
from dataclasses import dataclass
from typing import Protocol

from acquisition.errors import FrameError
from acquisition.modbus.requests import MAX_PDU_BYTES, ReadRequest

_MBAP = struct.Struct(">HHHB")
_POLYNOMIAL, _CRC_START = 0xA001, 0xFFFF


@dataclass(frozen=True)
class Asked:
    """A request that was sent to a unit and not answered yet; `transaction` counts over TCP."""

    request: ReadRequest
    unit: int
    transaction: int = 0


class Framing(Protocol):
    """How requests and replies lie on a wire."""

    def frame(self, asked: Asked) -> bytes:
        """Bytes of a request."""
        ...

    def take(self, data: memoryview, asked: Asked) -> tuple[int, memoryview] | None:
        """Judge received bytes as the reply to a request.

        Returns
        -------
        Bytes that the reply fills, and the reply from its function code on; None while the bytes
        may still become the right one.

        Raises
        ------
        FrameError
            If they never can.
        """
        ...


class TcpFraming:
    """Modbus TCP: transaction, protocol, length and unit before the reply."""

    def frame(self, asked: Asked) -> bytes:
        """Bytes of a request."""
        pdu = asked.request.pdu
        return _MBAP.pack(asked.transaction, 0, len(pdu) + 1, asked.unit) + pdu

    def take(self, data: memoryview, asked: Asked) -> tuple[int, memoryview] | None:
        """Judge received bytes; see `Framing`."""
        if len(data) <= _MBAP.size:
            return None
        transaction, protocol, length, unit = _MBAP.unpack_from(data)
        _require_equal("transaction id", transaction, asked.transaction)
        _require_equal("protocol id", protocol, 0)
        _require_equal("unit id", unit, asked.unit)
        pdu = data[_MBAP.size : _MBAP.size + max(length - 1, 1)]
        n_least, n_told = asked.request.least_bytes(pdu), length - 1
        # a reply whose length is not known from the request has to agree with itself
        if n_told < n_least or n_told > MAX_PDU_BYTES or (len(pdu) >= n_least < n_told):
            raise FrameError(f"length is {length}, expected {n_least + 1}")
        return (_MBAP.size + n_told, pdu) if len(pdu) == n_told else None


class RtuFraming:
    """Modbus RTU: unit before the reply, CRC-16 behind it."""

    def frame(self, asked: Asked) -> bytes:
        """Bytes of a request."""
        body = bytes((asked.unit,)) + asked.request.pdu
        return body + crc16(body).to_bytes(2, "little")

    def take(self, data: memoryview, asked: Asked) -> tuple[int, memoryview] | None:
        """Judge received bytes; see `Framing`."""
        if len(data) < 2:
            return None
        _require_equal("unit id", data[0], asked.unit)
        end = 1 + asked.request.least_bytes(data[1:])
        if len(data) < end + 2:
            return None
        found, expected = int.from_bytes(data[end : end + 2], "little"), crc16(data[:end])
        if found != expected:
            raise FrameError(f"CRC is {found:#06x}, expected {expected:#06x}")
        return end + 2, data[1:end]


def _crc_of_byte(value: int) -> int:
    for _ in range(8):
        value = value >> 1 ^ (_POLYNOMIAL if value & 1 else 0)
    return value


_CRC_OF_BYTE = tuple(map(_crc_of_byte, range(256)))


def crc16(data: bytes | memoryview) -> int:
    """CRC-16 of Modbus RTU (Modbus over Serial Line 1.02, 6.2.2)."""
    crc = _CRC_START
    for byte in data:
        crc = crc >> 8 ^ _CRC_OF_BYTE[(crc ^ byte) & 0xFF]
    return crc


def _require_equal(name: str, found: int, expected: int) -> None:
    if found != expected:
        raise FrameError(f"{name} is {found}, expected {expected}")
