"""`CanDevice`: a simulated unit behind a CAN DAQ; samples in, frames out; no bus, no time."""

from collections import deque
from dataclasses import replace

from acquisition.delivery.raw import RawBlock
from acquisition.errors import ConfigError
from acquisition.simulated.devices.can_frames import FrameEncoder, WireFrame
from acquisition.simulated.devices.can_shape import CanShape
from acquisition.simulated.feed import FeedEndedError, Ledger, RawFeed
from core.units import NS_PER_S

_U32 = 1 << 32


class CanDevice:
    """One unit's converter and CAN controller; the first block is there from the start.

    Parameters
    ----------
    feed
        Where the samples come from.
    unit
        Name under which the ledger books.
    block_samples
        Samples in a block, each of which begins with health, time and slow values.
    buffer_blocks
        Blocks that wait while nobody listens; then the oldest are lost.

    Attributes
    ----------
    frozen
        Blocks for which the converter stands still: the last one is sent again.
    ended
        Whether the feed has nothing more to give.

    Raises
    ------
    ConfigError
        If feed and shape have different channels.
    """

    def __init__(
        self,
        feed: RawFeed,
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
        self.frozen = 0
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
        """Whether a block waits to be sent."""
        return bool(self._waiting)

    @property
    def is_full(self) -> bool:
        """Whether the next block pushes the oldest one out."""
        return len(self._waiting) == self._waiting.maxlen

    def next_frames(self) -> list[WireFrame]:
        """Take the oldest block that waits.

        Raises
        ------
        LookupError
            If none does.
        """
        return self._waiting.popleft()

    def produce(self, n_blocks: int = 1) -> None:
        """Let the converter run; once the feed has ended, nothing happens."""
        for _ in range(n_blocks):
            try:
                self._take(self._feed.advance(self.block_samples))
            except FeedEndedError:
                self.ended = True
                return

    def restart(self) -> None:
        """Power off and on: the count begins at zero, in the next epoch."""
        self._n_restarts += 1
        self._index_offset = None

    def _take(self, raw: RawBlock) -> None:
        self._pass_time(raw)
        if self._index_offset is None:
            self._index_offset = -raw.first_index
        sent = replace(
            raw,
            epoch=(raw.epoch + self._n_restarts) % _U32,
            first_index=raw.first_index + self._index_offset,
        )
        self.ledger.offer(self._unit, sent.epoch, raw.n_samples)
        if self.frozen and self._last:
            self.frozen -= 1
        else:
            self._last = self._encoder.frames(sent)
        self._waiting.append(self._last)

    def _pass_time(self, raw: RawBlock) -> None:
        """Gaps take as long as they took; a restart, of which nobody knows how long, takes none."""
        epoch, stop = self._stop
        n_passed = raw.stop_index - stop
        if raw.epoch != epoch or n_passed < raw.n_samples:
            n_passed = raw.n_samples
        self._stop = (raw.epoch, raw.stop_index)
        self.elapsed_ns += round(n_passed * NS_PER_S / raw.rate_hz)


def _require_fit(first: RawBlock, shape: CanShape) -> None:
    found = (len(first.counts), len(first.slow))
    expected = (len(shape.channels), len(shape.slow))
    if found != expected:
        raise ConfigError(
            f"simulated CAN DAQ: channels and slow channels are {found} in the feed, {expected} in"
            " its messages"
        )
    floats = first.counts.dtype.kind == "f"
    if floats != shape.floats:
        kinds = {False: "a converter's counts", True: "engineering units"}
        names = {False: "padwatch_int16", True: "padwatch_float32"}
        raise ConfigError(
            f"simulated CAN DAQ: the samples are {kinds[floats]}, which need the profile"
            f' "{names[floats]}", not "{names[shape.floats]}"'
        )
