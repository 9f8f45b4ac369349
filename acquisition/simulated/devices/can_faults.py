"""What a faulty CAN device, or a faulty bus, does to the frames of a block."""

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from acquisition.simulated.devices.can_frames import FrameKind, WireFrame, shortened

Item: TypeAlias = WireFrame | bytes
"""A frame, or, on a text protocol, a line as it stands."""

_LONG_LINE = b"t100" + b"8" * 5000 + b"\r"
_FOREIGN_ID = 0x7F0
_FLOOD = 10
"""Foreign frames before each of the device's own."""


class FrameFaults:
    """Applies faults to waveform frames, one after the other, in the order in which they were told.

    Parameters
    ----------
    as_line
        How the transport writes a frame as text; None if it does not.
    """

    def __init__(self, as_line: Callable[[WireFrame], bytes] | None = None) -> None:
        self._as_line = as_line
        self._waiting: deque[Callable[[WireFrame], list[Item]]] = deque()
        self._random = np.random.default_rng(20261121)
        self._held: WireFrame | None = None
        self.known: dict[str, Callable[[WireFrame], list[Item]]] = {
            "drop": lambda _: [],
            "repeat": lambda frame: [frame, frame],
            "reorder": self._hold_back,
            "wrong_dlc": lambda frame: [shortened(frame)],
            "error_frame": lambda frame: [_bare(FrameKind.ERROR), frame],
            "bus_off": lambda _: [_bare(FrameKind.BUS_OFF)],
            "flood": lambda frame: [*(self._foreign() for _ in range(_FLOOD)), frame],
            "rtr": lambda frame: [replace(frame, kind=FrameKind.REMOTE, data=b"", fd=False), frame],
            "extended_twin": lambda frame: [self._twin(frame), frame],
        }
        if as_line is not None:
            self.known |= {
                "non_hex_line": lambda frame: [self._non_hex(as_line(frame))],
                "long_line": lambda frame: [_LONG_LINE, frame],
                "truncated_line": lambda frame: [as_line(frame)[:-6] + b"\r"],
            }

    def inject(self, fault: str, count: int) -> None:
        """Spoil the next waveform frames, so many of them."""
        self._waiting.extend([self.known[fault]] * count)

    def applied(self, frames: Iterable[WireFrame]) -> list[Item]:
        """What is sent instead of these frames."""
        items: list[Item] = []
        for frame in frames:
            if not frame.wave or not (self._waiting or self._held):
                items.append(frame)
            elif self._held is not None and frame.frame_id == self._held.frame_id:
                items += [frame, self._held]
                self._held = None
            elif self._held is not None or not self._waiting:
                items.append(frame)
            else:
                items += self._waiting.popleft()(frame)
        return items

    def _hold_back(self, frame: WireFrame) -> list[Item]:
        """Let the next frame of the same message overtake this one."""
        self._held = frame
        return []

    def _foreign(self) -> WireFrame:
        frame_id = _FOREIGN_ID + int(self._random.integers(0, 15))
        return WireFrame(frame_id, False, False, self._random.bytes(8))

    def _twin(self, frame: WireFrame) -> WireFrame:
        data = self._random.bytes(len(frame.data))
        return replace(frame, extended=not frame.extended, data=data, wave=False)

    def _non_hex(self, line: bytes) -> bytes:
        place = int(self._random.integers(5, len(line) - 1))
        wrong = bytes([int(self._random.choice(list(b"gGxX?!zZ -_")))])
        return line[:place] + wrong + line[place + 1 :]


def _bare(kind: FrameKind) -> WireFrame:
    return WireFrame(0, False, False, b"", kind)
