"""Sample feed of a simulated DAQ from a recording."""

from collections import deque
from collections.abc import Iterable

from acquisition.delivery.blocks import BlockJoiner
from acquisition.recordings.reader import Recording
from acquisition.recordings.source import Selection, all_of
from acquisition.simulated.feed import FeedEndedError
from core.samples.blocks import SampleBlock


class RecordedFeed:
    """Sample feed that returns recorded samples in blocks of the requested length.

    Blocks begin at multiples of their length and keep epoch, sample index and time of the
    recording. A block before a gap of the recording or a restart of the device is shorter. A block
    joined from several recorded blocks has the slow values of its first sample; a channel is OK if
    it is OK in all of them. Samples that were rejected during recording are a gap. `selection`
    defines the channels and their order; by default all channels as recorded.
    """

    def __init__(self, recording: Recording, selection: Selection | None = None) -> None:
        self._runs = recording.blocks()
        self._selection = selection or all_of(recording.manifest)
        self._joiner = BlockJoiner(self._selection.calibration.block_samples)
        self._length = 0
        self._ready: deque[SampleBlock] = deque()

    def advance(self, n_samples: int) -> SampleBlock:
        """Return the next block, of at most `n_samples` samples per channel.

        Raises
        ------
        FeedEndedError
            If the recording has ended.
        ConfigError
            If a file of the recording cannot be read.
        ValueError
            If `n_samples` is less than 1.
        """
        if n_samples < 1:
            raise ValueError(f"n_samples must be at least 1, got {n_samples}")
        if n_samples != self._length:
            self._cut_to(n_samples)
        while not self._ready:
            run = next(self._runs, None)
            found = self._joiner.put([self._selection.of(run)]) if run else self._joiner.flush()
            self._extend(found)
            if run is None and not self._ready:
                raise FeedEndedError
        return self._ready.popleft()

    def close(self) -> None:
        """Close the files of the recording."""
        self._runs.close()

    def _cut_to(self, n_samples: int) -> None:
        self._ready, held = deque(), [*self._ready, *self._joiner.flush()]
        self._joiner, self._length = BlockJoiner(n_samples), n_samples
        self._extend(self._joiner.put(held))

    def _extend(self, blocks: Iterable[SampleBlock]) -> None:
        self._ready.extend(cell for block in blocks for cell in block.cells())
