"""`Tape`: keeps all samples of units, and lets go of some rather than be in anybody's way."""

import asyncio
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from operator import methodcaller
from pathlib import Path

import structlog

from acquisition.clock import Clock
from acquisition.errors import ConfigError
from acquisition.recordings.manifest import RecordedUnit
from core.samples.blocks import SampleBlock
from service.recordings.continuous.joining import clear_unfinished, join, unjoined
from service.recordings.continuous.last import last_end
from service.recordings.continuous.pieces import Hole, Shed, TapeSettings
from service.recordings.continuous.unit_tape import TapeError, UnitTape
from service.runtime.heartbeats import UNHEARD, Pulse

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


def unpressed() -> Shed | None:
    """Nothing is more urgent."""
    return None


class Tape:
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
        settings: TapeSettings,
        clock: Clock,
        press: Callable[[], Shed | None] = unpressed,
        owned: Collection[str] = (),
    ) -> None:
        self._owned = {*units, *owned}
        self._root, self._units, self._settings = root, units, settings
        self._clock, self._press = clock, press
        self._tapes: dict[str, UnitTape] = {}
        self._seen: dict[str, tuple[int, int]] = {}
        self._holes: dict[str, Hole] = {unit: Hole() for unit in units}
        self._waiting: deque[tuple[float, SampleBlock]] = deque()
        self._n_waiting = 0
        self._busy_since_s: float | None = None
        self._shed_s: float | None = None
        self._shed_reason: Shed | None = None
        self._unjoined: deque[Path] = deque()
        self._is_closed = False
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="tape")
        self.error: str | None = None
        self.n_shed: Counter[Shed] = Counter()
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
        return WORDS[self._shed_reason or Shed.DISK_SLOW]

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

    def _slow(self) -> Shed | None:
        """Whether the disk does not keep up."""
        now_s = self._clock.monotonic_s()
        since = [self._busy_since_s] if self._busy_since_s is not None else []
        since += [self._waiting[0][0]] if self._waiting else []
        is_late = bool(since) and now_s - min(since) > MAX_WAIT_S
        is_late = is_late or self._n_waiting > MAX_WAITING_SAMPLES
        return Shed.DISK_SLOW if is_late else None

    def _shed(self, block: SampleBlock, reason: Shed) -> None:
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

    def _tried(self, unit: str, do: Callable[[UnitTape], None]) -> str | None:
        tape = self._tapes.get(unit) or self._begin(unit)
        before = tape.n_refused
        try:
            do(tape)
        except TapeError as error:
            self.n_shed[Shed.DISK_REFUSED] += tape.n_refused - before
            return str(error)
        finally:
            self._unjoined.extend(tape.ended)
            tape.ended.clear()
        self.n_shed[Shed.DISK_REFUSED] += tape.n_refused - before
        return None

    def _begin(self, unit: str) -> UnitTape:
        end = last_end(self._root, unit)
        tape = self._tapes[unit] = UnitTape(self._root, self._units[unit], self._settings, end)
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
            self._tell(self._tried(unit, UnitTape.end))
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
    Shed.ANALYSIS_BEHIND: "the analysis is behind, and comes first",
    Shed.DISK_SLOW: "the disk is too slow for them",
    Shed.DISK_FULL: "the disk is nearly full",
    Shed.DISK_REFUSED: "the disk refuses them",
}
