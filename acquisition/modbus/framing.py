"""Modbus framing over TCP and RTU: encodes requests and extracts replies from received bytes.

A reply must match its request in all bytes except the data read; a mismatch is an error. Parsing
stops at the first error, because the start of the next reply is then unknown.
"""

import struct
from typing import NamedTuple, TypeAlias

from acquisition.errors import FrameError
from acquisition.modbus.requests import MAX_PDU_BYTES, ReadRequest

_MBAP = struct.Struct(">HHHB")
_POLYNOMIAL, _CRC_START = 0xA001, 0xFFFF


class PendingRequest(NamedTuple):
    """Request in flight, with the unit id of the device and the transaction id (TCP only)."""

    request: ReadRequest
    unit: int
    transaction: int = 0


class TcpFraming:
    """Modbus TCP framing: header (transaction id, protocol id, length, unit id) before the PDU."""

    def frame(self, pending: PendingRequest) -> bytes:
        """Return the bytes of the frame that carries a request."""
        pdu = pending.request.pdu
        return _MBAP.pack(pending.transaction, 0, len(pdu) + 1, pending.unit) + pdu

    def take(self, data: memoryview, pending: PendingRequest) -> tuple[int, bytes] | None:
        """Extract the reply to a request from received bytes.

        Returns
        -------
        Length of the reply frame in bytes, and the PDU in it (from the function code on); None if
        the reply is still incomplete.

        Raises
        ------
        FrameError
            If the bytes are not the start of a valid reply.
        """
        if len(data) <= _MBAP.size:
            return None
        transaction, protocol, length, unit = _MBAP.unpack_from(data)
        found, expected = (transaction, protocol, unit), (pending.transaction, 0, pending.unit)
        if found != expected:
            raise FrameError(f"transaction, protocol and unit id are {found}, expected {expected}")
        n_stated = length - 1
        pdu = data[_MBAP.size : _MBAP.size + max(n_stated, 1)]
        n_arrived, n_min = len(pdu), pending.request.min_bytes(pdu)
        # the two lengths of a reply of variable length must agree
        if n_stated < n_min or n_stated > MAX_PDU_BYTES or (n_arrived >= n_min < n_stated):
            raise FrameError(f"length is {length} bytes, expected {n_min + 1}")
        return (_MBAP.size + n_stated, pdu.tobytes()) if n_arrived == n_stated else None


class RtuFraming:
    """Modbus RTU framing: the unit id before the PDU, a CRC-16 after the PDU."""

    def frame(self, pending: PendingRequest) -> bytes:
        """Return the bytes of the frame that carries a request."""
        body = bytes((pending.unit,)) + pending.request.pdu
        return body + crc16(body).to_bytes(2, "little")

    def take(self, data: memoryview, pending: PendingRequest) -> tuple[int, bytes] | None:
        """Return the frame length in bytes and the PDU of a reply; None if it is incomplete.

        Raises FrameError if the bytes are not the start of a valid reply to the request.
        """
        if len(data) < 2:
            return None
        if data[0] != pending.unit:
            raise FrameError(f"unit id is {data[0]}, expected {pending.unit}")
        end = 1 + pending.request.min_bytes(data[1:])
        if len(data) < end + 2:
            return None
        found, expected = int.from_bytes(data[end : end + 2], "little"), crc16(data[:end])
        if found != expected:
            raise FrameError(f"CRC is {found:#06x}, expected {expected:#06x}")
        return end + 2, data[1:end].tobytes()


Framing: TypeAlias = TcpFraming | RtuFraming


def _crc_of_byte(value: int) -> int:
    for _ in range(8):
        value = value >> 1 ^ (_POLYNOMIAL if value & 1 else 0)
    return value


_CRC_OF_BYTE = tuple(map(_crc_of_byte, range(256)))


def crc16(data: bytes | memoryview) -> int:
    """Return the CRC-16 of Modbus RTU (Modbus over Serial Line 1.02, 6.2.2)."""
    crc = _CRC_START
    for byte in data:
        crc = crc >> 8 ^ _CRC_OF_BYTE[(crc ^ byte) & 0xFF]
    return crc
