"""Modbus TCP framing that lets only reads out and only the one right reply in.

pymodbus 3.16.1 takes a transaction id of 0 for any, and checks neither function, byte count nor
register count of a reply, nor what follows it. This framer knows the outstanding request, so it
knows the first nine bytes of its answer in advance; whatever differs is a fault. It also hands the
registers over as bytes, which spares a Python integer for each of them.
"""

import struct
from dataclasses import dataclass

from pymodbus.framer import FramerSocket
from pymodbus.pdu import DecodePDU, ModbusPDU

from acquisition.errors import ConfigError

READ_HOLDING_REGISTERS = 3
READ_INPUT_REGISTERS = 4
READ_FUNCTIONS = (READ_HOLDING_REGISTERS, READ_INPUT_REGISTERS)
"""The only function codes that can leave this process."""

_HEAD = struct.Struct(">HHHBBB")
_EXCEPTION_BIT = 0x80
_EXCEPTION_BYTES = 9


class RegisterReply(ModbusPDU):
    """What came back: registers as bytes, the exception code, or what was wrong."""

    def __init__(self, payload: bytes = b"", refusal: int | None = None, fault: str = "") -> None:
        super().__init__()
        self.payload = payload
        self.refusal = refusal
        self.fault = fault


@dataclass(frozen=True)
class _Expected:
    """The reply that the outstanding request allows."""

    request: ModbusPDU
    head: bytes
    exception_head: bytes
    n_bytes: int


class ReadOnlyFramer(FramerSocket):
    """One outstanding read, one acceptable reply."""

    def __init__(self) -> None:
        super().__init__(DecodePDU(False))
        self.unasked = ""
        self._expected: _Expected | None = None

    @property
    def awaiting(self) -> bool:
        """Whether a request is outstanding."""
        return self._expected is not None

    def buildFrame(self, message: ModbusPDU) -> bytes:  # noqa: N802 - pymodbus calls it so
        """Frame a request and remember which reply it allows.

        Raises
        ------
        ConfigError
            If the request is anything but a read of registers.
        """
        function = message.function_code
        if function not in READ_FUNCTIONS:
            raise ConfigError(f"function code {function} is never sent, only {READ_FUNCTIONS}")
        tid, unit, n_bytes = message.transaction_id, message.dev_id, 2 * message.count
        self._expected = _Expected(
            message,
            _HEAD.pack(tid, 0, 3 + n_bytes, unit, function, n_bytes),
            _HEAD.pack(tid, 0, 3, unit, function | _EXCEPTION_BIT, 0)[:-1],
            _HEAD.size + n_bytes,
        )
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
        if self._expected is None:
            self.unasked = f"{len(data)} bytes came unasked: {data[:16].hex()}"
            return len(data), None
        reply = _judge(data, self._expected)
        if reply is None:
            return 0, None
        reply.dev_id = self._expected.request.dev_id
        reply.transaction_id = self._expected.request.transaction_id
        self._expected = None
        return len(data), reply


def _judge(data: bytes, expected: _Expected) -> RegisterReply | None:
    """Return the reply, or None while the bytes may still become the right one."""
    head = data[: _HEAD.size]
    if expected.head.startswith(head) and len(data) <= expected.n_bytes:
        return RegisterReply(data[_HEAD.size :]) if len(data) == expected.n_bytes else None
    if expected.exception_head.startswith(data[: _HEAD.size - 1]) and len(data) <= _EXCEPTION_BYTES:
        complete = len(data) == _EXCEPTION_BYTES
        return RegisterReply(refusal=data[-1]) if complete else None
    return RegisterReply(fault=_difference(data, expected))


def _difference(data: bytes, expected: _Expected) -> str:
    """Say what is wrong with a reply, field by field."""
    names = ("transaction id", "protocol id", "length", "unit id", "function code", "byte count")
    found = data[: _HEAD.size].ljust(_HEAD.size, b"\0")
    for name, wanted, got in zip(
        names, _HEAD.unpack(expected.head), _HEAD.unpack(found), strict=True
    ):
        if wanted != got:
            return f"{name} is {got}, expected {wanted}: {data[:16].hex()}"
    return (
        f"{len(data) - expected.n_bytes} bytes follow the reply: {data[expected.n_bytes :].hex()}"
    )
