"""Continuous recording: all samples of units, and what is left out under pressure."""

import asyncio
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
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
from service.recordings.folders import KIND, unit_of
from service.recordings.segment import Segment, SegmentSettings, clear_unfinished, join, unjoined
from service.runtime.heartbeats import UNHEARD, Pulse


class DropReason(StrEnum):
    """Why samples are not in a continuous recording; what the recording itself says."""

    ANALYSIS_BEHIND = "analysis_behind"
    DISK_SLOW = "disk_slow"
    DISK_FULL = "disk_full"
    DISK_REFUSED = "disk_refused"
    NOT_RUNNING = "not_running"
    GAP_BEFORE = "gap_before"
    """A gap of the device itself, where one recording ends and the next begins."""


@dataclass
class Omission:
    """Samples that were offered and are left out, all of one epoch.

    Parameters
    ----------
    n_samples
        By reason, per channel.
    """

    epoch: int = 0
    n_samples: Counter[str] = field(default_factory=Counter)

    def add(self, epoch: int, rejected: Iterable[Rejection]) -> None:
        """Leave out more; what was of an earlier epoch has no place in a later one."""
        if epoch != self.epoch:
            self.epoch, self.n_samples = epoch, Counter()
        for each in rejected:
            self.n_samples[each.reason] += each.n_samples

    def skip(self, block: SampleBlock, reason: str) -> None:
        """Leave out a block, with what was refused before it."""
        self.add(block.epoch, (*block.rejected, Rejection(reason, block.n_samples)))

    def before(self, block: SampleBlock) -> SampleBlock:
        """The block that says what is missing before it."""
        if not self.n_samples or self.epoch != block.epoch:
            return block
        total = self.n_samples.copy()
        for each in block.rejected:
            total[each.reason] += each.n_samples
        return replace(block, rejected=tuple(Rejection(r, n) for r, n in total.items()))

    def clear(self) -> None:
        """Begin anew: it has been said."""
        self.n_samples = Counter()


class RecordingError(Exception):
    """Samples could not be kept; the message says of which unit and why."""


class UnitRecorder:
    """Puts blocks one after the other into stretches.

    Parameters
    ----------
    end
        Epoch and index up to which the unit is recorded already; None if nothing is known.

    Attributes
    ----------
    ended
        Stretches that are to be joined.
    n_written, n_refused
        Samples per channel that are on the disk since the start, and that the disk refused.
    """

    def __init__(
        self,
        root: Path,
        unit: RecordedUnit,
        settings: SegmentSettings,
        end: tuple[int, int] | None = None,
    ) -> None:
        self._root, self._unit, self._settings = root, unit, settings
        self._end = end
        self._has_begun = False
        self._stretch: Segment | None = None
        self._hole = Omission()
        self.ended: list[Path] = []
        self.n_written = self.n_refused = 0

    def skip(self, hole: Omission) -> None:
        """Note what was left out before the next block."""
        self._hole.add(hole.epoch, (Rejection(r, n) for r, n in hole.n_samples.items()))

    def write(self, block: SampleBlock, now_s: float) -> None:
        """Append a block; a stretch that it does not fit is ended.

        Raises
        ------
        RecordingError
            If it cannot be kept, or if what was to be kept before it cannot.
        """
        fresh = self._fresh(block)
        if fresh is None:
            return
        block = fresh
        if self._stretch is not None and not self._stretch.goes_on_to(block):
            self.end()
        try:
            self._put(block, now_s)
        except (ConfigError, OSError):
            with suppress(RecordingError):  # counted; it may be of another type than the stretch
                self.end()
            self._try_again(block, now_s)
        self._hole.clear()
        self._has_begun, self._end = True, (block.epoch, block.stop_index)
        self.sync(now_s)

    def sync(self, now_s: float) -> None:
        """Bring the part that is being written to the disk, if it is time.

        Raises
        ------
        RecordingError
            If it cannot be kept.
        """
        if self._stretch is not None and self._stretch.is_due(now_s):
            self._finish_part(self._stretch)

    def end(self) -> None:
        """End the stretch, with what there is.

        Raises
        ------
        RecordingError
            If its last part cannot be kept.
        """
        stretch, self._stretch = self._stretch, None
        if stretch is not None:
            self.ended.append(stretch.folder)
            self._finish_part(stretch)

    def _fresh(self, block: SampleBlock) -> SampleBlock | None:
        """What of a block is not recorded already, as after a restart; None if all of it is."""
        if self._end is None or self._end[0] != block.epoch or block.first_index >= self._end[1]:
            return block
        if block.stop_index <= self._end[1]:
            return None
        return block.from_sample(self._end[1] - block.first_index)

    def _put(self, block: SampleBlock, now_s: float) -> None:
        told = self._hole.before(block)
        if self._stretch is None:
            told = self._after_end(told)
            self._root.mkdir(parents=True, exist_ok=True)
            self._stretch = Segment(self._root, self._unit, told, self._settings)
        self._stretch.write(told, now_s)

    def _try_again(self, block: SampleBlock, now_s: float) -> None:
        try:
            self._put(block, now_s)
        except (ConfigError, OSError) as error:
            self._hole.skip(block, DropReason.DISK_REFUSED)
            self.n_refused += block.n_samples
            with suppress(RecordingError):
                self.end()
            raise self._told(error) from error

    def _finish_part(self, stretch: Segment) -> None:
        n_samples = stretch.n_unsynced
        try:
            self.n_written += stretch.finish_part()
        except (ConfigError, OSError) as error:
            self.n_refused += n_samples
            if self._end is not None:
                self._hole.add(self._end[0], [Rejection(DropReason.DISK_REFUSED, n_samples)])
            raise self._told(error) from error

    def _after_end(self, block: SampleBlock) -> SampleBlock:
        """The first block of a stretch, which says what is missing since the one before it."""
        if self._end is None or self._end[0] != block.epoch:
            return block
        n_missing = block.first_index - self._end[1] - sum(r.n_samples for r in block.rejected)
        if n_missing <= 0:
            return block
        reason = DropReason.GAP_BEFORE if self._has_begun else DropReason.NOT_RUNNING
        return replace(block, rejected=(*block.rejected, Rejection(reason, n_missing)))

    def _told(self, error: Exception) -> RecordingError:
        return RecordingError(f"samples of unit {self._unit.unit} are not recorded: {error}")


MAX_TRIED = 3
"""Newest recordings that are looked at, should the newest be damaged."""


def last_end(root: Path, unit: str) -> tuple[int, int] | None:
    """Epoch and index after the last sample that is recorded of a unit; None if none is known."""
    # another unit may have a name that begins like that of this one
    of_unit = (path for path in root.glob(f"{unit}-*-{KIND}*") if unit_of(path.name) == unit)
    for folder in sorted(of_unit, reverse=True)[:MAX_TRIED]:
        try:
            if read_manifest(folder).unit == unit:
                return _end_of(folder)
        except ConfigError:
            continue  # the check of recordings tells of it
    return None


def _end_of(folder: Path) -> tuple[int, int] | None:
    end = None
    for head in open_recording(folder).heads():
        end = (head.epoch, head.first_index + head.n_samples)
    return end


log = structlog.get_logger()

WRITE_EVERY_S = 1.0

MAX_WAIT_S = 20.0
"""Longest that blocks wait for a slow disk, which is also what a kill may cost beyond a part."""

MAX_WAITING_SAMPLES = 20_000_000
"""Of all channels and units together: 80 MB."""

MAX_BUSY_S = 60.0
"""Longest that the disk may take for what is handed to it at once."""

MAX_END_S = 2.0
"""Longest that the end of the service waits for stretches to be joined; the next start does it."""

TOLD_S = 60.0
"""For how long after the last sample that was let go of this counts as trouble."""


def unpressed() -> DropReason | None:
    """Nothing is more urgent."""
    return None


class ContinuousRecorder:
    """The continuous recordings of all units; told of every block, writes in a thread of its own.

    Parameters
    ----------
    root
        Folder of the recordings.
    units
        What is recorded; blocks of others are let pass.
    press
        Why nothing is to be recorded just now, if so.
    owned
        Units whose recordings may have been left unfinished, recorded now or not.

    Attributes
    ----------
    n_shed
        Samples per channel that were offered and are not recorded, by reason.
    n_finished
        Recordings that have got their name.
    error
        Why samples could not be written last; None since they could.
    """

    def __init__(
        self,
        root: Path,
        units: Mapping[str, RecordedUnit],
        settings: SegmentSettings,
        clock: Clock,
        press: Callable[[], DropReason | None] = unpressed,
        owned: Collection[str] = (),
    ) -> None:
        self._owned = {*units, *owned}
        self._root, self._units, self._settings = root, units, settings
        self._clock, self._press = clock, press
        self._tapes: dict[str, UnitRecorder] = {}
        self._seen: dict[str, tuple[int, int]] = {}
        self._holes: dict[str, Omission] = {unit: Omission() for unit in units}
        self._waiting: deque[tuple[float, SampleBlock]] = deque()
        self._n_waiting = 0
        self._busy_since_s: float | None = None
        self._shed_s: float | None = None
        self._shed_reason: DropReason | None = None
        self._unjoined: deque[Path] = deque()
        self._is_closed = False
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="tape")
        self.error: str | None = None
        self.n_shed: Counter[DropReason] = Counter()
        self.n_finished = 0

    @property
    def units(self) -> Iterable[str]:
        """Whose samples are recorded."""
        return self._units

    @property
    def n_written(self) -> int:
        """Samples per channel that are on the disk, of all units since the start."""
        return sum(tape.n_written for tape in self._tapes.values())

    @property
    def trouble(self) -> str | None:
        """Why samples are not recorded now, or were not in the last minute."""
        if self.error is not None:
            return self.error
        if self._shed_s is None or self._clock.monotonic_s() - self._shed_s > TOLD_S:
            return None
        return WORDS[self._shed_reason or DropReason.DISK_SLOW]

    def take(self, block: SampleBlock) -> None:
        """Take in a block, or let it go and remember how much that was; never waits."""
        if block.unit not in self._units or self._is_closed:
            return
        fresh = self._fresh(block)
        if fresh is None:
            return
        reason = self._press() or self._slow()
        if reason is not None:
            self._shed(fresh, reason)
            return
        told = self._holes[block.unit].before(fresh)
        self._holes[block.unit].clear()
        self._waiting.append((self._clock.monotonic_s(), told))
        self._n_waiting += told.samples.size

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Write what is to be written, for ever; afterwards `close`."""
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
        """Finish what is being made, with what there is, and let go of the thread."""
        self._is_closed = True
        await self._write()
        await self._in_thread(self._end)
        self._thread.shutdown(wait=False)

    def _fresh(self, block: SampleBlock) -> SampleBlock | None:
        """What of a block has not been here; None if all of it has."""
        epoch, stop = self._seen.get(block.unit, (None, 0))
        if epoch == block.epoch and block.first_index < stop:
            if block.stop_index <= stop:
                return None
            block = block.from_sample(stop - block.first_index)
        self._seen[block.unit] = (block.epoch, block.stop_index)
        return block

    def _slow(self) -> DropReason | None:
        """Whether the disk does not keep up."""
        now_s = self._clock.monotonic_s()
        since = [self._busy_since_s] if self._busy_since_s is not None else []
        since += [self._waiting[0][0]] if self._waiting else []
        is_late = bool(since) and now_s - min(since) > MAX_WAIT_S
        is_late = is_late or self._n_waiting > MAX_WAITING_SAMPLES
        return DropReason.DISK_SLOW if is_late else None

    def _shed(self, block: SampleBlock, reason: DropReason) -> None:
        if self.trouble is None:
            log.warning("samples are not recorded", reason=WORDS[reason])
        self._holes[block.unit].skip(block, reason)
        self.n_shed[reason] += block.n_samples
        self._shed_s, self._shed_reason = self._clock.monotonic_s(), reason

    async def _write(self) -> None:
        blocks = [block for _, block in self._waiting]
        self._waiting.clear()
        self._n_waiting = 0
        await self._in_thread(self._put, blocks)

    def _put(self, blocks: Sequence[SampleBlock]) -> None:
        """Write blocks, and join one stretch; in the thread."""
        now_s, error = self._clock.monotonic_s(), None if blocks else self.error
        for block in blocks:
            write = methodcaller("write", block, now_s)
            error = self._tried(block.unit, write) or error
        for unit in self._tapes:
            error = self._tried(unit, methodcaller("sync", now_s)) or error
        self._tell(self._join_one() or error)

    def _tried(self, unit: str, do: Callable[[UnitRecorder], None]) -> str | None:
        tape = self._tapes.get(unit) or self._begin(unit)
        before = tape.n_refused
        try:
            do(tape)
        except RecordingError as error:
            self.n_shed[DropReason.DISK_REFUSED] += tape.n_refused - before
            return str(error)
        finally:
            self._unjoined.extend(tape.ended)
            tape.ended.clear()
        self.n_shed[DropReason.DISK_REFUSED] += tape.n_refused - before
        return None

    def _begin(self, unit: str) -> UnitRecorder:
        end = last_end(self._root, unit)
        tape = self._tapes[unit] = UnitRecorder(self._root, self._units[unit], self._settings, end)
        return tape

    def _join_one(self) -> str | None:
        if not self._unjoined:
            return None
        folder = self._unjoined[0]
        try:
            self.n_finished += join(folder)
        except (ConfigError, OSError) as error:
            self._unjoined.rotate(-1)
            return f"{folder.name} cannot be finished: {error}"
        self._unjoined.popleft()
        return None

    def _end(self) -> None:
        """End all stretches, and join what there is time for; in the thread."""
        for unit in list(self._tapes):
            self._tell(self._tried(unit, UnitRecorder.end))
        until_s = self._clock.monotonic_s() + MAX_END_S
        for _ in range(len(self._unjoined)):
            if self._clock.monotonic_s() < until_s:
                self._tell(self._join_one())

    def _recover(self) -> None:
        """Make recordings of what a crash has left; in the thread."""
        try:
            left = unjoined(self._root, self._owned)
            clear_unfinished(self._root, self._owned)
        except OSError as error:
            self._tell(str(error))
            return
        self._unjoined.extend(left)
        for folder in left:
            self._tell(self._join_one())
            if folder.exists():
                log.warning("an unfinished recording is finished", folder=folder.name)

    def _tell(self, error: str | None) -> None:
        if error is not None and error != self.error:
            log.error("samples are not recorded", reason=error)
        if error is None and self.error is not None:
            log.info("samples are recorded again")
        self.error = error

    async def _in_thread(self, do: Callable[..., None], *arguments: object) -> None:
        self._busy_since_s = self._clock.monotonic_s()
        await asyncio.get_running_loop().run_in_executor(self._thread, do, *arguments)
        self._busy_since_s = None


WORDS = {
    DropReason.ANALYSIS_BEHIND: "the analysis is behind, and comes first",
    DropReason.DISK_SLOW: "the disk is too slow for them",
    DropReason.DISK_FULL: "the disk is nearly full",
    DropReason.DISK_REFUSED: "the disk refuses them",
}
