"""Framing, TCP and RTU, that lets only reads out and only the one right reply in.

pymodbus 3.16.1 takes a transaction id of 0 for any, and checks neither function, byte count nor
register count of a reply, nor what follows it. These framers know the outstanding request, so they
know its answer in advance but for the values; whatever differs is a fault. They also hand registers
over as bytes, which spares a Python integer for each of them.
"""

import struct
from dataclasses import dataclass
from typing import ClassVar

from pymodbus.framer import FramerRTU, FramerSocket
from pymodbus.framer.base import FramerBase
from pymodbus.pdu import DecodePDU, ModbusPDU

from acquisition.errors import FrameError
from acquisition.modbus.requests import (
    EXCEPTION_BIT,
    MAX_PDU_BYTES,
    ReplyShape,
    least_bytes,
    reply_to,
    require_read,
)

_MBAP = struct.Struct(">HHHB")
_SHOWN_BYTES = 16


class Reply(ModbusPDU):
    """What came back: the whole reply from its function code on, or what was wrong."""

    def __init__(self, pdu: bytes = b"", fault: str = "") -> None:
        super().__init__()
        self.pdu = pdu
        self.fault = fault

    @property
    def refusal(self) -> int | None:
        """The exception code, if the device refuses."""
        return self.pdu[1] if self.pdu and self.pdu[0] & EXCEPTION_BIT else None


@dataclass(frozen=True)
class _Asked:
    """The outstanding request and the reply it allows."""

    request: ModbusPDU
    shape: ReplyShape

    def least_bytes(self, pdu: bytes) -> int:
        return least_bytes(self.request.function_code, self.shape, pdu)


class ReadOnlyFramer(FramerBase):
    """One outstanding read, one acceptable reply.

    Attributes
    ----------
    unasked
        What came while nothing was outstanding, as words; empty if nothing did.
    n_received
        Bytes that have come since the last request, or unasked.
    """

    head_bytes: ClassVar[int]
    tail_bytes: ClassVar[int]

    def __init__(self) -> None:
        super().__init__(DecodePDU(False))
        self.forget()

    def forget(self) -> None:
        """Start anew, as with a new connection."""
        self.unasked = ""
        self.n_received = 0
        self._asked: _Asked | None = None

    @property
    def awaiting(self) -> bool:
        """Whether a request is outstanding."""
        return self._asked is not None

    def buildFrame(self, message: ModbusPDU) -> bytes:  # noqa: N802 - pymodbus calls it so
        """Frame a request and remember which reply it allows.

        Raises
        ------
        ConfigError
            If the request is anything but a read.
        """
        require_read(message.function_code)
        self._asked = _Asked(message, reply_to(message.function_code, message.encode()))
        self.n_received = 0
        return super().buildFrame(message)

    def handleFrame(  # noqa: N802 - pymodbus calls it so
        self,
        data: bytes,
        exp_devid: int,  # noqa: ARG002 - known from the request
        exp_tid: int,  # noqa: ARG002
    ) -> tuple[int, ModbusPDU | None]:
        """Judge all bytes received since the request was sent.

        Returns
        -------
        tuple
            Bytes used up, and the reply if it is complete or wrong.
        """
        if self._asked is None:
            self.n_received += len(data)
            self.unasked = f"{len(data)} bytes came unasked: {data[:_SHOWN_BYTES].hex()}"
            return len(data), None
        self.n_received = len(data)
        try:
            reply = self._judge(data, self._asked)
        except FrameError as fault:
            reply = Reply(fault=f"{fault}: {data[:_SHOWN_BYTES].hex()}")
        if reply is None:
            return 0, None
        reply.dev_id = self._asked.request.dev_id
        reply.transaction_id = self._asked.request.transaction_id
        self._asked = None
        return len(data), reply

    def _judge(self, data: bytes, asked: _Asked) -> Reply | None:
        """Return the reply, or None while the bytes may still become the right one."""
        if len(data) <= self.head_bytes:
            return None
        n_expected = self.head_bytes + self._pdu_bytes(data, asked) + self.tail_bytes
        if len(data) < n_expected:
            return None
        if len(data) > n_expected:
            raise FrameError(f"{len(data) - n_expected} bytes follow the reply")
        return Reply(self._checked_pdu(data))

    def _pdu_bytes(self, data: bytes, asked: _Asked) -> int:
        """Bytes that the reply has between head and tail, or more than are there."""
        raise NotImplementedError

    def _checked_pdu(self, data: bytes) -> bytes:
        """Return what is between head and tail of a complete reply."""
        raise NotImplementedError


class TcpFramer(ReadOnlyFramer, FramerSocket):
    """Modbus TCP: transaction, protocol, length and unit before the reply."""

    head_bytes = _MBAP.size
    tail_bytes = 0

    def _pdu_bytes(self, data: bytes, asked: _Asked) -> int:
        length: int
        tid, protocol, length, unit = _MBAP.unpack_from(data)
        request = asked.request
        _require_equal("transaction id", tid, request.transaction_id)
        _require_equal("protocol id", protocol, 0)
        _require_equal("unit id", unit, request.dev_id)
        pdu = data[_MBAP.size :]
        n_least, n_told = asked.least_bytes(pdu), length - 1
        # a reply whose length is not known from the request has to agree with itself
        if n_told < n_least or n_told > MAX_PDU_BYTES or (len(pdu) >= n_least < n_told):
            raise FrameError(f"length is {length}, expected {n_least + 1}")
        return n_told

    def _checked_pdu(self, data: bytes) -> bytes:
        return data[_MBAP.size :]


class RtuFramer(ReadOnlyFramer, FramerRTU):
    """Modbus RTU: unit before the reply, CRC-16 behind it."""

    head_bytes = 1
    tail_bytes = 2

    def _pdu_bytes(self, data: bytes, asked: _Asked) -> int:
        _require_equal("unit id", data[0], asked.request.dev_id)
        return asked.least_bytes(data[1:])

    def _checked_pdu(self, data: bytes) -> bytes:
        found, expected = int.from_bytes(data[-2:], "big"), self.compute_CRC(data[:-2])
        if found != expected:
            raise FrameError(f"CRC is {found:#06x}, expected {expected:#06x}")
        return data[1:-2]


def _require_equal(name: str, found: int, expected: int) -> None:
    if found != expected:
        raise FrameError(f"{name} is {found}, expected {expected}")
