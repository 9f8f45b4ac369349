"""`RecordedFeed`: a recording as the feed of a simulated DAQ."""

from collections import deque

from acquisition.delivery.blocks import BlockGrid
from acquisition.delivery.calibration import RawBlock
from acquisition.recordings.reader import Recording
from acquisition.recordings.source import Selection, all_of
from acquisition.simulated.feed import FeedEndedError


class RecordedFeed:
    """Recorded samples in pieces of the requested length.

    Pieces begin at multiples of their length and keep epoch, index and stamps of the recording. A
    piece is shorter before a gap of the recording or a restart of the device. A piece of several
    recorded blocks has the slow values of its first sample, and is OK where all blocks are. Samples
    that were rejected during recording are a gap.

    Parameters
    ----------
    selection
        Channels and their order; all as recorded by default.
    """

    def __init__(self, recording: Recording, selection: Selection | None = None) -> None:
        self._blocks = recording.raw_blocks()
        self._selection = selection or all_of(recording.manifest)
        self._grid = BlockGrid(self._selection.calibration.block_samples)
        self._length = 0
        self._ready: deque[RawBlock] = deque()

    def advance(self, n_samples: int) -> RawBlock:
        """Return the next samples, at most this many.

        Raises
        ------
        FeedEndedError
            If the recording has ended.
        ConfigError
            If a file of the recording cannot be read any more.
        ValueError
            If no samples are requested.
        """
        if n_samples < 1:
            raise ValueError(f"{n_samples} samples asked for; at least one is needed")
        if n_samples != self._length:
            self._cut_to(n_samples)
        while not self._ready:
            block = next(self._blocks, None)
            self._ready.extend(self._grid.flush() if block is None else self._put(block))
            if block is None and not self._ready:
                raise FeedEndedError
        return self._ready.popleft()

    def close(self) -> None:
        """Close the recording's files."""
        self._blocks.close()

    def _put(self, block: RawBlock) -> list[RawBlock]:
        return self._grid.put(self._selection.of(block))

    def _cut_to(self, n_samples: int) -> None:
        held = [*self._ready, *self._grid.flush()]
        self._grid, self._length = BlockGrid(n_samples), n_samples
        self._ready = deque(piece for block in held for piece in self._grid.put(block))
