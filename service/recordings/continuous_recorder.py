"""Continuous recording of the samples of units; under overload samples are dropped."""

import asyncio
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import StrEnum
from operator import methodcaller
from pathlib import Path

import structlog

from acquisition.clock import Clock
from acquisition.errors import ConfigError
from acquisition.recordings.manifest import RecordedUnit, read_manifest
from acquisition.recordings.reader import open_recording
from core.samples.blocks import Rejection, SampleBlock
from service.recordings.folders import CONTINUOUS, remove_incomplete, unit_of
from service.recordings.segment import Segment, SegmentSettings, WriterThread, join, unjoined
from service.runtime.heartbeats import UNHEARD, Pulse


class DropReason(StrEnum):
    """Reason, as stated in a continuous recording, why samples are missing from it."""

    ANALYSIS_BEHIND = "analysis_behind"
    DISK_SLOW = "disk_slow"
    DISK_FULL = "disk_full"
    DISK_REFUSED = "disk_refused"
    NOT_RUNNING = "not_running"
    GAP_BEFORE = "gap_before"
    """Samples that the device did not deliver between two segments."""


WORDS = {
    DropReason.ANALYSIS_BEHIND: "the analysis is behind and has priority",
    DropReason.DISK_SLOW: "the disk is too slow",
    DropReason.DISK_FULL: "the disk is nearly full",
    DropReason.DISK_REFUSED: "the disk refuses writes",
}

Position = tuple[int, int]
"""Epoch, and index of the sample after the last recorded sample."""


@dataclass
class _Omission:
    """Counts of the samples dropped in one epoch since the last recorded block.

    Parameters
    ----------
    n_samples
        Number of dropped samples per channel, by reason.
    """

    epoch: int = 0
    n_samples: Counter[str] = field(default_factory=Counter)

    def add(self, epoch: int, rejected: Iterable[Rejection]) -> None:
        """Add dropped samples to the counts; a new epoch first resets the counts."""
        if epoch != self.epoch:
            self.epoch, self.n_samples = epoch, Counter()
        for each in rejected:
            self.n_samples[each.reason] += each.n_samples

    def add_block(self, block: SampleBlock, reason: str) -> None:
        """Count the samples of a dropped block, under `reason`, and those rejected before it."""
        self.add(block.epoch, (*block.rejected, Rejection(reason, block.n_samples)))

    def before(self, block: SampleBlock) -> SampleBlock:
        """Return a copy of a block that lists the dropped samples as rejected before the block."""
        if not self.n_samples or self.epoch != block.epoch:
            return block
        total = self.n_samples.copy()
        for each in block.rejected:
            total[each.reason] += each.n_samples
        return replace(block, rejected=tuple(Rejection(r, n) for r, n in total.items()))

    def clear(self) -> None:
        """Reset the counts, after a recorded block has listed the dropped samples."""
        self.n_samples = Counter()


def _unseen_part(block: SampleBlock, end: Position | None) -> SampleBlock | None:
    """Return the part of a block after the position `end`; None if no samples are left.

    The whole block is returned if `end` is None, of another epoch, or not within the block.
    """
    if end is None or end[0] != block.epoch or block.first_index >= end[1]:
        return block
    return None if block.stop_index <= end[1] else block.from_sample(end[1] - block.first_index)


class RecordingError(Exception):
    """Error raised if samples are not recorded; the message states the unit and the reason."""


class UnitRecorder:
    """Recorder of one unit; writes the sample blocks to consecutive segments of recordings.

    Parameters
    ----------
    end
        Position up to which the unit is already recorded; None if unknown.

    Attributes
    ----------
    ended
        Finished segments that are still to be joined.
    n_written
        Number of samples per channel synced to the disk since the start.
    n_refused
        Number of samples per channel since the start that could not be written.
    """

    def __init__(
        self,
        root: Path,
        unit: RecordedUnit,
        settings: SegmentSettings,
        end: Position | None = None,
    ) -> None:
        self._root, self._unit, self._settings = root, unit, settings
        self._end = end
        self._has_begun = False
        self._segment: Segment | None = None
        self._omission = _Omission()
        self.ended: list[Path] = []
        self.n_written = self.n_refused = 0

    def write(self, block: SampleBlock, now_s: float) -> None:
        """Append a block; start a new segment if the open segment does not cover the block.

        `now_s` is the monotonic time. Raises `RecordingError` if the block, or an earlier block,
        cannot be recorded.
        """
        unseen = _unseen_part(block, self._end)
        if unseen is None:
            return
        if self._segment is not None and not self._segment.covers(unseen):
            self.end()
        try:
            self._put(unseen, now_s)
        except (ConfigError, OSError):
            with suppress(RecordingError):  # the error is counted; the sample type may have changed
                self.end()
            self._retry(unseen, now_s)
        self._omission.clear()
        self._has_begun, self._end = True, (unseen.epoch, unseen.stop_index)
        self.sync(now_s)

    def sync(self, now_s: float) -> None:
        """Sync the open part of the segment to the disk if its duration has been reached.

        `now_s` is the monotonic time. Raises `RecordingError` if the part cannot be written.
        """
        if self._segment is not None and self._segment.is_due(now_s):
            self._finish_part(self._segment)

    def end(self) -> None:
        """End the open segment, if any, and add its folder to `ended`.

        Raises `RecordingError` if the last part of the segment cannot be written.
        """
        segment, self._segment = self._segment, None
        if segment is not None:
            self.ended.append(segment.folder)
            self._finish_part(segment)

    def _put(self, block: SampleBlock, now_s: float) -> None:
        block = self._omission.before(block)
        if self._segment is None:
            block = self._after_end(block)
            self._root.mkdir(parents=True, exist_ok=True)
            self._segment = Segment(self._root, self._unit, block, self._settings)
        self._segment.write(block, now_s)

    def _retry(self, block: SampleBlock, now_s: float) -> None:
        try:
            self._put(block, now_s)
        except (ConfigError, OSError) as error:
            self._omission.add_block(block, DropReason.DISK_REFUSED)
            self.n_refused += block.n_samples
            with suppress(RecordingError):
                self.end()
            raise self._error(error) from error

    def _finish_part(self, segment: Segment) -> None:
        n_samples = segment.n_unsynced
        try:
            self.n_written += segment.finish_part()
        except (ConfigError, OSError) as error:
            self.n_refused += n_samples
            if self._end is not None:
                self._omission.add(self._end[0], [Rejection(DropReason.DISK_REFUSED, n_samples)])
            raise self._error(error) from error

    def _after_end(self, block: SampleBlock) -> SampleBlock:
        """Return a copy of a block that lists the samples missing since the last segment."""
        if self._end is None or self._end[0] != block.epoch:
            return block
        n_missing = block.first_index - self._end[1] - sum(r.n_samples for r in block.rejected)
        if n_missing <= 0:
            return block
        reason = DropReason.GAP_BEFORE if self._has_begun else DropReason.NOT_RUNNING
        return replace(block, rejected=(*block.rejected, Rejection(reason, n_missing)))

    def _error(self, error: Exception) -> RecordingError:
        return RecordingError(f"samples of unit {self._unit.unit} are not recorded: {error}")


MAX_TRIED = 3
"""Maximum number of recordings that `last_end` tries to read, newest first."""


def last_end(root: Path, unit: str) -> Position | None:
    """Return the position up to which a unit is recorded on the disk; None if unknown."""
    # the glob also matches units whose identifier begins with this identifier
    names = (path for path in root.glob(f"{unit}-*-{CONTINUOUS}*") if unit_of(path.name) == unit)
    for folder in sorted(names, reverse=True)[:MAX_TRIED]:
        try:
            if read_manifest(folder).unit != unit:
                continue
            end = None
            for heads, _ in open_recording(folder).heads():
                epoch, first_index, _, n_samples, *_ = heads[-1].item()
                end = (epoch, first_index + n_samples)
        except ConfigError:
            continue  # reported by the check of recordings
        return end
    return None


log = structlog.get_logger()

WRITE_EVERY_S = 1.0

MAX_WAIT_S = 20.0
"""Maximum time of a block in the queue, in seconds; a crash loses the queue and the open part."""

MAX_WAITING_SAMPLES = 20_000_000
"""Maximum number of samples in the queue, summed over channels and units: 80 MB."""

MAX_BUSY_S = 60.0
"""Maximum duration of one write, in seconds."""

MAX_END_S = 2.0
"""Maximum time to join segments at shutdown, in seconds; the next start joins the rest."""

REPORTED_S = 60.0
"""Time in seconds after a dropped sample during which `trouble` reports the reason."""


class ContinuousRecorder(WriterThread):
    """Recorder that continuously writes the samples of units to the disk.

    Parameters
    ----------
    units
        Units to record; blocks of other units are ignored.
    pressure
        Function that returns the reason to drop samples at present; None to record them.
    owned
        Ids of further units whose unfinished recordings are completed at the start.

    Attributes
    ----------
    n_dropped
        Number of samples per channel that were not recorded, by reason.
    """

    def __init__(
        self,
        root: Path,
        units: Mapping[str, RecordedUnit],
        settings: SegmentSettings,
        clock: Clock,
        pressure: Callable[[], DropReason | None] = lambda: None,
        owned: Collection[str] = (),
    ) -> None:
        super().__init__("tape", "samples", clock)
        self._owned = {*units, *owned}
        self._root, self._units, self._settings = root, units, settings
        self._pressure = pressure
        self._recorders: dict[str, UnitRecorder] = {}
        self._seen: dict[str, Position] = {}
        self._omissions: dict[str, _Omission] = {unit: _Omission() for unit in units}
        self._waiting: deque[tuple[float, SampleBlock]] = deque()
        self._n_waiting = 0
        self._dropped: tuple[float, DropReason] | None = None
        self._unjoined: deque[Path] = deque()
        self._is_closed = False
        self.n_dropped: Counter[DropReason] = Counter()

    @property
    def units(self) -> Iterable[str]:
        """Units whose samples are recorded."""
        return self._units

    @property
    def n_written(self) -> int:
        """Number of samples per channel synced to the disk since the start, of all units."""
        return sum(recorder.n_written for recorder in self._recorders.values())

    @property
    def trouble(self) -> str | None:
        """Reason why samples were not recorded in the last minute; None if all were recorded."""
        if self.error is not None:
            return self.error
        if self._dropped is None or self._clock.monotonic_s() - self._dropped[0] > REPORTED_S:
            return None
        return WORDS[self._dropped[1]]

    def take(self, block: SampleBlock) -> None:
        """Queue a block for writing, or drop the block under overload and count its samples."""
        if block.unit not in self._units or self._is_closed:
            return
        unseen = _unseen_part(block, self._seen.get(block.unit))
        if unseen is None:
            return
        self._seen[block.unit] = (block.epoch, block.stop_index)
        reason = self._pressure() or self._slowness()
        if reason is not None:
            self._drop(unseen, reason)
            return
        unseen = self._omissions[block.unit].before(unseen)
        self._omissions[block.unit].clear()
        self._waiting.append((self._clock.monotonic_s(), unseen))
        self._n_waiting += unseen.counts.size

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Write queued blocks until cancelled, with heartbeats to `pulse`; then call `close`."""
        pulse.beat(10 * MAX_BUSY_S)
        await self._in_thread(self._recover)
        if not self._units:
            pulse.rest()
            await asyncio.Event().wait()
        while True:
            pulse.beat(MAX_BUSY_S + WRITE_EVERY_S)
            await self._write()
            await self._clock.sleep(WRITE_EVERY_S)

    async def close(self) -> None:
        """Finish all recordings with the samples received until now, and stop the thread."""
        self._is_closed = True
        await self._write()
        await self._in_thread(self._end)
        self._thread.shutdown(wait=False)

    def _slowness(self) -> DropReason | None:
        since = [] if self._busy_since_s is None else [self._busy_since_s]
        since += [self._waiting[0][0]] if self._waiting else []
        is_late = bool(since) and self._clock.monotonic_s() - min(since) > MAX_WAIT_S
        is_slow = is_late or self._n_waiting > MAX_WAITING_SAMPLES
        return DropReason.DISK_SLOW if is_slow else None

    def _drop(self, block: SampleBlock, reason: DropReason) -> None:
        if self.trouble is None:
            log.warning("samples are not recorded", reason=WORDS[reason])
        self._omissions[block.unit].add_block(block, reason)
        self.n_dropped[reason] += block.n_samples
        self._dropped = (self._clock.monotonic_s(), reason)

    async def _write(self) -> None:
        blocks = [block for _, block in self._waiting]
        self._waiting.clear()
        self._n_waiting = 0
        await self._in_thread(self._put, blocks)

    def _put(self, blocks: Sequence[SampleBlock]) -> None:
        """Write blocks and join one segment; runs in the writer thread."""
        now_s, error = self._clock.monotonic_s(), None if blocks else self.error
        for block in blocks:
            error = self._try(block.unit, methodcaller("write", block, now_s)) or error
        for unit in self._recorders:
            error = self._try(unit, methodcaller("sync", now_s)) or error
        self._note(self._join_one() or error)

    def _try(self, unit: str, do: Callable[[UnitRecorder], None]) -> str | None:
        """Call a function with the recorder of a unit; return its error message, or None."""
        if unit not in self._recorders:
            self._recorders[unit] = UnitRecorder(
                self._root, self._units[unit], self._settings, last_end(self._root, unit)
            )
        recorder = self._recorders[unit]
        before = recorder.n_refused
        try:
            do(recorder)
        except RecordingError as error:
            return str(error)
        finally:
            self._unjoined.extend(recorder.ended)
            recorder.ended.clear()
            self.n_dropped[DropReason.DISK_REFUSED] += recorder.n_refused - before
        return None

    def _join_one(self) -> str | None:
        if not self._unjoined:
            return None
        folder = self._unjoined[0]
        try:
            join(folder)
        except (ConfigError, OSError) as error:
            self._unjoined.rotate(-1)
            return f"{folder.name} cannot be finished: {error}"
        self._unjoined.popleft()
        return None

    def _end(self) -> None:
        """End all segments, and join segments for up to `MAX_END_S`; runs in the writer thread."""
        for unit in list(self._recorders):
            self._note(self._try(unit, UnitRecorder.end))
        until_s = self._clock.monotonic_s() + MAX_END_S
        for _ in range(len(self._unjoined)):
            if self._clock.monotonic_s() < until_s:
                self._note(self._join_one())

    def _recover(self) -> None:
        try:
            left = unjoined(self._root, self._owned)
            remove_incomplete(self._root, self._owned)
        except OSError as error:
            self._note(str(error))
            return
        self._unjoined.extend(left)
        for folder in left:
            self._note(self._join_one())
            if folder.exists():
                log.warning("an unfinished recording was completed", folder=folder.name)
