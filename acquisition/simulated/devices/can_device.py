"""Simulated CAN data acquisition (DAQ): buffered frames of sample blocks, and frame faults."""

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from acquisition.errors import ConfigError
from acquisition.simulated.devices.can_frames import FrameEncoder, FrameKind, WireFrame, shortened
from acquisition.simulated.devices.can_shape import CanShape
from acquisition.simulated.feed import FeedEndedError, Ledger, SampleFeed
from core.samples.blocks import SampleBlock
from core.units import NS_PER_S

Item: TypeAlias = WireFrame | bytes
"""Item to be sent: a CAN frame, or a line of the slcan text protocol."""

_LONG_LINE = b"t100" + b"8" * 5000 + b"\r"
_FOREIGN_ID = 0x7F0
_FLOOD = 10
"""Number of unrelated frames that the fault ``flood`` sends before one waveform frame."""


class FrameFaults:
    """Injector of faults into waveform frames, one fault per frame, in the order of injection.

    `as_line` encodes a frame as a line of the slcan text protocol, for faults of lines; None if
    frames are not sent as text.
    """

    def __init__(self, as_line: Callable[[WireFrame], bytes] | None = None) -> None:
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
        """Queue a fault for the next `count` waveform frames without a fault.

        `fault` is a name in the attribute `known`.
        """
        self._waiting.extend([self.known[fault]] * count)

    def applied(self, frames: Iterable[WireFrame]) -> list[Item]:
        """Apply the queued faults to `frames`; return the items to be sent instead, in order.

        An item is a frame, or a line of the slcan text protocol as bytes.
        """
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
        """Return no items now; the frame is sent after the next frame with the same id."""
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


_U32 = 1 << 32


class CanDevice:
    """Simulated CAN DAQ of one unit, with a buffer of sample blocks as CAN frames.

    The buffer contains the first block from the start.

    Parameters
    ----------
    shape
        Channels and message format; the channels must be those of `feed`.
    unit
        Name of the unit in the ledger.
    ledger
        Count of the produced samples; a new one by default.
    block_samples
        Number of samples per channel in a block.
    buffer_blocks
        Maximum number of buffered blocks; a new block then replaces the oldest block.

    Attributes
    ----------
    ended
        Whether the feed has ended.
    elapsed_ns
        Total duration of the produced blocks and of the gaps between them, in nanoseconds.

    Raises
    ------
    ConfigError
        If feed and shape differ in the number of channels or in the sample type.
    FeedEndedError
        If the feed is empty.
    """

    def __init__(
        self,
        feed: SampleFeed,
        shape: CanShape,
        unit: str = "U1",
        ledger: Ledger | None = None,
        block_samples: int = 50,
        buffer_blocks: int = 64,
    ) -> None:
        self._feed = feed
        self._unit = unit
        self._encoder = FrameEncoder(shape)
        self.ledger = ledger or Ledger()
        self.block_samples = block_samples
        self._n_frozen = 0
        self.ended = False
        self._waiting: deque[list[WireFrame]] = deque(maxlen=buffer_blocks)
        self._n_restarts = 0
        self._index_offset: int | None = 0
        self._last: list[WireFrame] = []
        self._stop = (0, 0)
        self.elapsed_ns = 0
        first = feed.advance(block_samples)
        _require_fit(first, shape)
        self._take(first)

    @property
    def has_frames(self) -> bool:
        """Whether the buffer contains a block."""
        return bool(self._waiting)

    @property
    def is_full(self) -> bool:
        """Whether the buffer is full, so that the next block replaces the oldest block."""
        return len(self._waiting) == self._waiting.maxlen

    def next_frames(self) -> list[WireFrame]:
        """Remove and return the frames of the oldest buffered block.

        Raises LookupError if the buffer is empty.
        """
        return self._waiting.popleft()

    def produce(self, n_blocks: int = 1) -> None:
        """Add the next `n_blocks` blocks of the feed to the buffer, or fewer if the feed ends."""
        for _ in range(n_blocks):
            try:
                self._take(self._feed.advance(self.block_samples))
            except FeedEndedError:
                self.ended = True
                return

    def freeze(self, n_blocks: int) -> None:
        """Replace each of the next `n_blocks` blocks by a copy of the last block."""
        self._n_frozen += n_blocks

    def restart(self) -> None:
        """Restart the device: the next block has sample index 0 in the next epoch."""
        self._n_restarts += 1
        self._index_offset = None

    def _take(self, raw: SampleBlock) -> None:
        self._pass_time(raw)
        if self._index_offset is None:
            self._index_offset = -raw.first_index
        sent = replace(
            raw,
            epoch=(raw.epoch + self._n_restarts) % _U32,
            first_index=raw.first_index + self._index_offset,
        )
        self.ledger.offer(self._unit, sent.epoch, raw.n_samples)
        if self._n_frozen and self._last:
            self._n_frozen -= 1
        else:
            self._last = self._encoder.frames(sent)
        self._waiting.append(self._last)

    def _pass_time(self, raw: SampleBlock) -> None:
        """Add the duration of a block, and of a gap before the block, to `elapsed_ns`."""
        epoch, stop = self._stop
        n_passed = raw.stop_index - stop
        if raw.epoch != epoch or n_passed < raw.n_samples:
            n_passed = raw.n_samples
        self._stop = (raw.epoch, raw.stop_index)
        self.elapsed_ns += round(n_passed * NS_PER_S / raw.rate_hz)


def _require_fit(first: SampleBlock, shape: CanShape) -> None:
    found = (len(first.counts), len(first.side.slow))
    expected = (len(shape.channels), len(shape.slow))
    if found != expected:
        raise ConfigError(
            f"simulated CAN DAQ: the feed has {found[0]} channels and {found[1]} slow channels,"
            f" expected {expected[0]} and {expected[1]}"
        )
    floats = first.counts.dtype.kind == "f"
    if floats != shape.floats:
        kinds = {False: "counts", True: "engineering units"}
        names = {False: "padwatch_int16", True: "padwatch_float32"}
        raise ConfigError(
            f"simulated CAN DAQ: samples in {kinds[floats]} require profile"
            f' "{names[floats]}", not "{names[shape.floats]}"'
        )
