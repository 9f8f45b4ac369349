"""Recorder: writes findings to the store in order and in batches, with retries."""

import asyncio
import json
import os
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import numpy as np
import structlog
from prometheus_client import Histogram

from acquisition.clock import Clock
from core.alarms.alarm import AlarmNews
from core.change.film_judge import FilmNews
from core.monitor.assessment import Assessment
from core.spectra.cross_spectrum import NO_SPECTRUM
from service.measuring.live_view import LiveView
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.metrics import MEASURED
from service.store.port import RefusedRowError, StoreError, UnitGap
from service.store.sharing import StreamPosition
from service.store.store import Store

FILE = "parked.jsonl"

MAX_BYTES = 16_000_000
"""Size in bytes above which a new file is begun; only one predecessor is kept."""


def park_rows(path: Path, time_ns: int, refused: Iterable[tuple[object, str]]) -> None:
    """Append pairs of refused row and reason to a JSON Lines file, private to its owner; sync it.

    `time_ns` is the time of the refusal, ns since 1970 UTC. Raises `OSError` if the file cannot be
    written.
    """
    lines = [
        json.dumps(
            {"time_ns": time_ns, "reason": reason, "kind": type(row).__name__, "row": row},
            default=_plain,
            skipkeys=True,
        )
        for row, reason in refused
    ]
    if path.exists() and path.stat().st_size > MAX_BYTES:
        path.replace(path.with_name(path.name + ".1"))
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
    with os.fdopen(descriptor, "a", encoding="ascii") as file:
        file.write("".join(f"{line}\n" for line in lines))
        file.flush()
        os.fsync(file.fileno())


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return {field.name: getattr(value, field.name) for field in fields(value)}
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return str(value)


log = structlog.get_logger()

RETRY_S = 1.0

MAX_NEWS = 100_000
"""Maximum number of queued changes of alarms (`AlarmNews`); about 100 MB."""

GIVEN_UP = "given_up"

T = TypeVar("T")


class NotStoredError(Exception):
    """Error raised if changes of alarms were not stored; the message states why."""


Finding: TypeAlias = Assessment | UnitGap | AlarmNews | FilmNews | StreamPosition
"""Finding of the analysis; the position on the stream follows the other findings of its block."""


COMMITS = Histogram(
    "padwatch_store_commit_duration_seconds",
    "This is the duration of writing findings to the disk, without failed attempts.",
    buckets=(0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0),
    registry=MEASURED,
)
"""A commit waits for the disk, and up to five seconds for the lock of the database."""


@dataclass(eq=False)
class Recorder:
    """Queue of findings that a thread writes to the store; a slow disk does not delay samples.

    Rows refused by the database are written to a file; all other rows are stored.

    Parameters
    ----------
    folder
        Folder of the file of refused rows.
    capacity
        Maximum number of queued findings; above it the oldest are dropped and counted in
        :attr:`LiveView.n_unstored`. Changes of alarms have a separate queue of `MAX_NEWS`.
    on_stored
        Function that is called after changes of alarms were written.
    finds_again
        Whether the next start reproduces unwritten findings from the stream of blocks.
    """

    store: Store
    live: LiveView
    clock: Clock
    folder: Path
    capacity: int = 15_000
    on_stored: Callable[[], None] = lambda: None
    finds_again: bool = field(default=False, kw_only=True)

    def __post_init__(self) -> None:
        self._waiting: deque[Finding] = deque()
        self._alarms: deque[AlarmNews] = deque()
        self._n_writing = 0
        self._waits_since_s = 0.0
        self._news = asyncio.Event()
        self._progress = asyncio.Condition()
        self._outcomes: dict[int, asyncio.Future[str | None]] = {}
        # the default threads may all be busy with requests
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="recorder")

    @property
    def n_waiting(self) -> int:
        """Number of queued findings plus queued changes of alarms."""
        return len(self._waiting) + len(self._alarms)

    @property
    def behind_s(self) -> float:
        """Time for which findings have waited without a successful write, s; 0 if none wait."""
        if not (self._waiting or self._alarms):
            return 0.0
        return self.clock.monotonic_s() - self._waits_since_s

    def put(self, findings: Iterable[Finding]) -> None:
        """Queue findings for writing; those of one call are stored in one transaction."""
        if not (self._waiting or self._alarms):
            self._waits_since_s = self.clock.monotonic_s()
        for finding in findings:
            if isinstance(finding, AlarmNews):
                self._alarms.append(finding)
            else:
                self._waiting.append(finding)
        self._drop_oldest()
        while len(self._alarms) > MAX_NEWS:
            self._resolve(self._alarms.popleft(), "the queue to the store is full")
            self.live.note_unstored(1, GIVEN_UP)
        self._news.set()

    async def stored(self) -> None:
        """Wait without limit until the newest change of an alarm is on the disk.

        Raises `NotStoredError` if the change was dropped, or refused by the database.
        """
        if not self._alarms:
            return
        key, loop = id(self._alarms[-1]), asyncio.get_running_loop()
        outcome = self._outcomes.setdefault(key, loop.create_future())
        refusal = await asyncio.shield(outcome)  # other callers may wait for it
        if refusal is not None:
            raise NotStoredError(refusal)

    async def reached(self, position: StreamPosition) -> None:
        """Wait without limit until a queued stream position is on the disk."""
        async with self._progress:
            await self._progress.wait_for(
                lambda: all(finding is not position for finding in self._waiting)
            )

    async def require_store(self) -> None:
        """Check the store by writing an empty transaction.

        Raises `StoreError` if nothing can be written now.
        """
        loop = asyncio.get_running_loop()
        await loop.run_in_executor(self._thread, self.store.append, [], [])

    async def settled(self) -> None:
        """Wait until all queued findings are written, or until the store refuses writes."""
        async with self._progress:
            await self._progress.wait_for(
                lambda: self.live.store_error or not (self._waiting or self._alarms)
            )

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Write queued findings until cancelled; `pulse` gets heartbeats."""
        while True:
            pulse.rest()
            await self._news.wait()
            self._news.clear()
            while self._waiting or self._alarms:
                pulse.beat(RETRY_S)
                if not await self._write():
                    await self.clock.sleep(RETRY_S)

    async def flush(self) -> None:
        """Try once to write all queued findings, at the end of the process."""
        if (self._waiting or self._alarms) and not await self._write():
            counts = {"n_findings": len(self._waiting), "n_alarm_news": len(self._alarms)}
            if self.finds_again:
                log.warning("results are not stored; the next start repeats them", **counts)
            else:
                log.error("results are lost: the process ends before they are stored", **counts)

    def _drop_oldest(self) -> None:
        """Drop the oldest findings above the capacity, except those being written."""
        while len(self._waiting) > self.capacity + self._n_writing:
            del self._waiting[self._n_writing]
            self.live.note_unstored(1, GIVEN_UP)

    async def _write(self) -> bool:
        batch, alarms = list(self._waiting), list(self._alarms)
        self._n_writing = len(batch)
        append = partial(self._append, [*alarms, *batch])
        try:
            refused = await asyncio.get_running_loop().run_in_executor(self._thread, append)
        except StoreError as error:
            if self.live.store_error is None:
                log.error("results are not being stored", reason=str(error))
            self.live.store_error = str(error)
            self._n_writing = 0
            self._drop_oldest()
            await self._notify()
            return False
        if self.live.store_error is not None:
            log.info("results are being stored again")
        self.live.store_error = None
        self._waits_since_s = self.clock.monotonic_s()
        if refused:
            reason = f"{refused[-1][1]} (parked in {FILE})"
            self.live.note_unstored(len(refused), reason)
            log.error("the database refused results", n_parked=len(refused), reason=reason)
        self._n_writing = 0
        self.live.note_stored(_only(Assessment, batch), _only(UnitGap, batch))
        _drop(self._waiting, batch)
        _drop(self._alarms, alarms)
        reasons = {id(row): reason for row, reason in refused}
        for news in alarms:
            self._resolve(news, reasons.get(id(news)))
        if alarms:
            self.on_stored()
        await self._notify()
        return True

    def _append(self, batch: Sequence[Finding]) -> list[tuple[object, str]]:
        """Store findings; write refused rows to the file, and return pairs of row and reason."""
        refused: list[tuple[object, str]] = []
        began_s = self.clock.monotonic_s()
        self._append_rows(batch, refused)
        COMMITS.observe(self.clock.monotonic_s() - began_s)
        if refused:
            path = self.folder / FILE
            try:
                park_rows(path, self.clock.now_ns(), refused)
            except OSError as error:
                raise StoreError(f"cannot write {path}: {error}") from error
        return refused

    def _append_rows(self, rows: Sequence[Finding], refused: list[tuple[object, str]]) -> None:
        """Store findings in one transaction; if the transaction is refused, store each half."""
        found = _only(Assessment, rows)
        try:
            self.store.append(
                found,
                _only(UnitGap, rows),
                _only(AlarmNews, rows),
                _only(FilmNews, rows),
                _only(StreamPosition, rows),
            )
        except RefusedRowError as error:
            middle = len(rows) // 2
            if middle:
                self._append_rows(rows[:middle], refused)
                self._append_rows(rows[middle:], refused)
                return
            self.store.append([], [])  # raises if the store refuses every write
            refused.append((rows[0], str(error)))
            if any(assessment.spectrum.frequency_hz.size for assessment in found):
                with suppress(RefusedRowError):  # the spectrum may be the refused part
                    self.store.append([replace(a, spectrum=NO_SPECTRUM) for a in found], [])

    def _resolve(self, news: AlarmNews, refusal: str | None) -> None:
        """Resolve the future of a change of an alarm; `refusal` is None if it was stored."""
        outcome = self._outcomes.pop(id(news), None)
        if outcome is not None and not outcome.done():
            outcome.set_result(refusal)

    async def _notify(self) -> None:
        async with self._progress:
            self._progress.notify_all()


def _only(kind: type[T], findings: Iterable[Finding]) -> list[T]:
    return [finding for finding in findings if isinstance(finding, kind)]


def _drop(queue: deque[T], written: Sequence[T]) -> None:
    ids = {id(entry) for entry in written}
    while queue and id(queue[0]) in ids:
        queue.popleft()
