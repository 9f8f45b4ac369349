"""slcan, the text protocol of serial CAN adapters: python-can's bus with a strict parser.

python-can reads byte by byte, accepts lines whose length differs from their length field, and
raises ValueError or other exceptions for lines that are no frames. This parser reads in chunks and
refuses each line that is not exactly one frame.
"""

from binascii import Error as HexError
from binascii import unhexlify
from collections import deque
from collections.abc import Container
from select import select
from typing import Any

from can import Message
from can.exceptions import error_check
from can.interfaces.slcan import slcanBus
from can.util import CAN_FD_DLC

from acquisition.can import gate
from acquisition.errors import ConfigError, FrameError

_MAX_LINE = 1 + 8 + 1 + 2 * 64
_CHUNK_BYTES = 65536
_STATE_LINE = 8
_FRAMES = b"tTrRdDbB"
"""First letters of frames: t data, r remote, d and b CAN FD; capital with an extended id."""

_ANSWERS = b"zZVvNF"
"""First letters of an adapter's replies to commands."""

_STATES = {
    b"a": (0, 0),
    b"w": (0, 0),
    b"p": (gate.CONTROLLER, gate.RX_PASSIVE | gate.TX_PASSIVE),
    b"b": (gate.BUS_OFF, 0),
}
"""Bits of the error frame of each status (active, warning, passive, bus-off), and the state of the
controller in it; no frame without bits."""


class SlcanBus(slcanBus):
    """python-can bus of an slcan adapter at a serial port, a pseudo-terminal or a TCP port.

    `ids` are the frame ids to receive, standard or extended.
    """

    def __init__(self, channel: str, ids: Container[int], **options: Any) -> None:
        self._ids = ids
        self._found: deque[Message | None] = deque()  # None for a malformed line
        self._rest = b""
        self._skipping = True  # the stream may begin in the middle of a line
        try:
            super().__init__(channel, **{"timeout": 0.0, **options})
        except Exception:  # the opening commands could not be sent
            port = getattr(self, "serialPortOrig", None)
            if port is not None:
                port.close()
            raise

    def _recv_internal(self, timeout: float | None) -> tuple[Message | None, bool]:
        """Return the next frame, or None at the timeout, and whether it passed the filter of ids.

        Raises FrameError for a line that is neither a frame nor a reply.
        """
        if not self._found:
            self._read_chunk(timeout)
        if not self._found:
            return None, False
        message = self._found.popleft()
        if message is None:
            raise FrameError("malformed slcan line")
        return message, True

    def _read_chunk(self, timeout: float | None) -> None:
        """Wait for received bytes, then read and parse all of them."""
        with error_check("could not read from the serial device"):
            ready, _, _ = select([self.fileno()], [], [], timeout)
            data = self.serialPortOrig.read(_CHUNK_BYTES) if ready else b""
        if data:
            self._take(data)

    def _take(self, data: bytes) -> None:
        *lines, self._rest = (self._rest + data).replace(b"\a", b"\r").split(b"\r")
        if self._skipping and lines:
            self._skipping, lines = False, lines[1:]
        for line in lines:
            try:
                message = _parsed(line, self._ids)
            except FrameError:
                self._found.append(None)
            else:
                self._found.extend([message] if message else [])
        if len(self._rest) > _MAX_LINE and not self._skipping:
            self._found.append(None)
            self._skipping = True
        if self._skipping:
            self._rest = b""

    @classmethod
    def require_speed(cls, bitrate: int | None, data_bitrate: int | None) -> None:
        """Check that slcan supports bit rates, in bit/s; None is accepted.

        Raises ConfigError if a bit rate is not supported; the message lists the supported rates.
        """
        for name, speed, known in (
            ("bitrate", bitrate, cls._BITRATES),
            ("data_bitrate", data_bitrate, cls._DATA_BITRATES),
        ):
            if speed is not None and speed not in known:
                words = ", ".join(str(n) for n in known if n)
                raise ConfigError(f"slcan: {name} must be one of {words} bit/s, got {speed}")

    def shutdown(self) -> None:
        """Close the adapter's channel and the port, even if the adapter is gone."""
        port = self.serialPortOrig
        socket = getattr(port, "_socket", None)  # pyserial does not close a reset socket
        try:
            super().shutdown()
        finally:
            port.close()
            if socket is not None:
                socket.close()


def _parsed(line: bytes, ids: Container[int]) -> Message | None:
    """Return the frame of a line; None for a reply or for an id that is not received.

    Raises FrameError if the line is neither a frame nor a reply.
    """
    kind = line[:1]
    if not kind or kind not in _FRAMES:
        return _state(line)
    extended, remote, fd = kind.isupper(), kind in b"rR", kind in b"dDbB"
    end = 9 if extended else 4
    try:
        # not int(…, 16), which accepts "0x1", "1_0" and " 1"
        frame_id = int.from_bytes(unhexlify(line[1:end].rjust(8, b"0")), "big")
        if frame_id not in ids:
            return None
        code = unhexlify(b"0" + line[end : end + 1])[0]
        data = unhexlify(line[end + 1 :])
    except (HexError, IndexError) as exc:
        raise FrameError("malformed slcan line") from exc
    length = CAN_FD_DLC[code] if fd else code
    is_sound = length <= (64 if fd else 8) and len(data) == (0 if remote else length)
    if not is_sound or frame_id >= (1 << 29 if extended else 1 << 11):
        raise FrameError("malformed slcan line")
    return Message(
        arbitration_id=frame_id,
        is_extended_id=extended,
        is_remote_frame=remote,
        is_fd=fd,
        bitrate_switch=kind in b"bB",
        dlc=length,
        data=data,
    )


def _state(line: bytes) -> Message | None:
    """Return the error frame of a status line (examples: "sb256256", "e1o"); None without error."""
    kind, what = line[:1], line[1:2]
    if not line or kind in _ANSWERS:
        return None
    if kind == b"s" and what in _STATES and len(line) == _STATE_LINE and line[2:].isdigit():
        bits, state = _STATES[what]
        return _error(bits, state) if bits else None
    if kind == b"e" and what.isdigit() and len(line) == 2 + int(what):
        bits = gate.PROTOCOL | gate.BUS_ERROR
        if b"o" in line[2:]:
            return _error(bits | gate.CONTROLLER, gate.RX_OVERFLOW)
        return _error(bits, 0)
    raise FrameError("malformed slcan line")


def _error(bits: int, state: int) -> Message:
    data = bytes([0, state]).ljust(8, b"\0")
    return Message(arbitration_id=bits, is_extended_id=False, is_error_frame=True, data=data)
