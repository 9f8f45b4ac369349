"""`RecordingSource`: a recording as a sample source that comes to an end."""

from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import aclosing, asynccontextmanager, closing

from acquisition.clock import Clock
from acquisition.delivery.blocks import BlockAssembler
from acquisition.recordings.progress import Progress
from acquisition.recordings.reader import Recording
from acquisition.recordings.selection import Selection, all_of
from core.samples.blocks import SampleBlock


class RecordingSource:
    """Calibrated blocks of a recording, as fast as they are taken or as they once came.

    Paced, the recording runs from the first connection on, connected or not: what passed while
    nobody was connected is missing, and the sample index jumps. Unpaced, a new connection goes on
    where the last one stopped. Gaps within an epoch take the time they took; a restart of the
    device, whose length nobody knows, takes none.

    Parameters
    ----------
    selection
        Which channels, and how to read them; all as recorded if not given.
    speed
        Seconds of the recording in a second, or None for unpaced.

    Raises
    ------
    ValueError
        If the speed is not positive.
    """

    def __init__(
        self,
        recording: Recording,
        clock: Clock,
        selection: Selection | None = None,
        speed: float | None = None,
    ) -> None:
        if speed is not None and not speed > 0.0:
            raise ValueError(f"a recording runs at a positive speed, not {speed}")
        self._recording = recording
        self._clock = clock
        self._selection = selection or all_of(recording.manifest)
        self._delivery = BlockAssembler(self._selection.calibration)
        self._speed = speed
        self._start_s: float | None = None
        self._next_block = 0
        self._progress = Progress()

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
        """Open the recording; see :class:`acquisition.source.SampleSource`.

        Raises
        ------
        ConfigError
            While iterating, if a file cannot be read any more.
        """
        if self._start_s is None:
            self._start_s = self._clock.monotonic_s()
        async with aclosing(self._blocks(self._elapsed_s())) as blocks:
            yield blocks

    async def _blocks(self, missed_s: float) -> AsyncGenerator[SampleBlock]:
        with closing(self._recording.raw_blocks(self._next_block)) as raw_blocks:
            for raw in raw_blocks:
                after = self._progress.after(
                    raw.epoch, raw.first_index, raw.counts.shape[1], raw.rejected
                )
                due_s = after.n_passed / raw.rate_hz / self._speed if self._speed else 0.0
                missed = 0.0 < due_s <= missed_s
                await self._clock.sleep(0.0 if missed else max(0.0, due_s - self._elapsed_s()))
                self._progress, self._next_block = after, self._next_block + 1
                if not missed:
                    for block in self._delivery.take(self._selection.of(raw)):
                        yield block
            for block in self._delivery.flush():
                yield block

    def _elapsed_s(self) -> float:
        return self._clock.monotonic_s() - (self._start_s or 0.0)
