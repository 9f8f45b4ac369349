"""`ModbusRtuServer`: a simulated device on a serial line, which is a pseudo-terminal."""

import asyncio
import contextlib
import os
import tty
from collections.abc import Mapping
from pathlib import Path

from pymodbus.framer import FramerRTU

from acquisition.clock import Clock
from acquisition.errors import LinkError
from acquisition.simulated.devices import line_link
from acquisition.simulated.devices.modbus_answers import HangUpError
from acquisition.simulated.devices.modbus_server import ModbusDevice, ModbusServer

_READ_BYTES = 4096
_FRAME_GAP_S = 0.05
"""Far above the 3.5 characters of the specification, far below any time-out of a reader."""

_REQUEST_BYTES = {0x18: 6, 43: 7}
_MOST_REQUESTS_BYTES = 8


class ModbusRtuServer(ModbusServer):
    """Serves a device to the one reader of a line. It has no bit rate and no parity.

    Parameters
    ----------
    link
        Symbolic link that is to point to the line as long as it is there; without it the line is
        only found under the name that the system gives it, which may change when it is re-entered.

    Raises
    ------
    LinkError, ConfigError
        On entering, if there is no pseudo-terminal to be had or the link cannot be made.
    """

    def __init__(
        self,
        device: ModbusDevice,
        clock: Clock | None = None,
        link: Path | None = None,
        *,
        patient: bool = False,
    ) -> None:
        super().__init__(device, clock, patient=patient)
        self._link = link
        self._line: tuple[int, int] | None = None
        self._name = ""
        self._received = b""
        self._received_at_s = 0.0

    @property
    def endpoint(self) -> Mapping[str, str | int]:
        """Path of the line, and that it has no parity."""
        return {"device": str(self._link or self._name), "parity": "none"}

    def cut(self) -> None:
        """Take the line away, and put another one in its place."""
        self._close()
        self._open()

    async def _listen(self) -> None:
        self._open()

    async def _stop_listening(self) -> None:
        self._close()

    def _n_connections(self) -> int:
        return 0  # a line does not tell whether anybody reads

    def _open(self) -> None:
        try:
            ours, theirs = os.openpty()
            self._line = ours, theirs
            self._name = os.ttyname(theirs)
        except OSError as exc:
            raise LinkError(f"cannot make a serial line {self._link or ''}: {exc}") from exc
        if self._link is not None:
            line_link.point(self._link, self._name)
        tty.setraw(theirs)
        os.set_blocking(ours, False)
        asyncio.get_running_loop().add_reader(ours, self._take)

    def _close(self) -> None:
        if self._line is None:
            return
        asyncio.get_running_loop().remove_reader(self._line[0])
        for end in self._line:
            os.close(end)
        self._line = None
        self._received = b""
        if self._link is not None:
            line_link.remove(self._link)

    def _take(self) -> None:
        if self._line is None:
            return
        now_s = asyncio.get_running_loop().time()
        if now_s - self._received_at_s > _FRAME_GAP_S:
            self._received = b""
        self._received_at_s = now_s
        with contextlib.suppress(BlockingIOError):
            self._received += os.read(self._line[0], _READ_BYTES)
        n_expected = _request_bytes(self._received)
        if len(self._received) >= n_expected:
            frame, self._received = self._received, b""
            self._answer(frame, n_expected)

    def _answer(self, frame: bytes, n_expected: int) -> None:
        """Answer a frame that is one; a device says nothing to anything else."""
        crc = int.from_bytes(frame[-2:], "big")
        if len(frame) != n_expected or not FramerRTU.check_CRC(frame[:-2], crc):
            return
        try:
            reply = self.reply(frame[1:-2])
        except HangUpError:
            self.cut()
            return
        if reply is not None and self._line is not None:
            body = frame[:1] + reply
            with contextlib.suppress(BlockingIOError):
                os.write(self._line[0], body + FramerRTU.compute_CRC(body).to_bytes(2, "big"))


def _request_bytes(frame: bytes) -> int:
    """Bytes of the whole request, by its function code."""
    return _REQUEST_BYTES.get(frame[1] if len(frame) > 1 else 0, _MOST_REQUESTS_BYTES)
