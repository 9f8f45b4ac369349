"""Findings on their way to the disk: in order, in batches, retried, never in the way."""

import asyncio
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

import structlog

from acquisition.clock import Clock
from core.alarms.event import AlarmNews
from core.assessment import Assessment
from core.films.film_judge import FilmNews
from service.heartbeats import UNHEARD, Pulse
from service.live import LiveView
from service.store.port import Store, StoreError, UnitGap
from service.store.positions_port import StreamPosition

log = structlog.get_logger()

RETRY_S = 1.0

MAX_NEWS = 100_000
"""News of alarms that wait for a store that does not answer; about 100 MB."""

T = TypeVar("T")


@dataclass(frozen=True)
class Findings:
    """What one block has taught: to be stored together or not at all."""

    assessments: Sequence[Assessment] = ()
    gaps: Sequence[UnitGap] = ()
    alarms: Sequence[AlarmNews] = ()
    films: Sequence[FilmNews] = ()
    position: StreamPosition | None = None


class Recorder:
    """Writes findings to the store in a thread, so that a slow disk delays no samples.

    Parameters
    ----------
    capacity
        Most findings that wait for a store that does not answer; beyond it the oldest are given up
        and counted in :attr:`LiveView.n_unstored`. News of alarms wait apart from them, up to
        `MAX_NEWS`, and are given up last.
    told
        Called when news of alarms has been written.
    timed
        Entered, in the thread, while the store writes.
    """

    def __init__(
        self,
        store: Store,
        live: LiveView,
        clock: Clock,
        capacity: int = 5000,
        told: Callable[[], None] = lambda: None,
        timed: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> None:
        self._store, self._live, self._clock = store, live, clock
        self._capacity, self._told, self._timed = capacity, told, timed
        self._waiting: deque[Findings] = deque()
        self._alarms: deque[AlarmNews] = deque()
        self._waits_since_s = 0.0
        self._news = asyncio.Event()
        self._progress = asyncio.Condition()
        # its own: the others may all be busy answering
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="recorder")

    @property
    def n_waiting(self) -> int:
        """Findings and news of alarms that are still to be written."""
        return len(self._waiting) + len(self._alarms)

    @property
    def behind_s(self) -> float:
        """For how long something has been waiting without anything being written."""
        if not (self._waiting or self._alarms):
            return 0.0
        return self._clock.monotonic_s() - self._waits_since_s

    def put(self, findings: Findings) -> None:
        """Queue findings."""
        if not (self._waiting or self._alarms):
            self._waits_since_s = self._clock.monotonic_s()
        if findings.assessments or findings.gaps or findings.position:
            self._waiting.append(replace(findings, alarms=()))
        if len(self._waiting) > self._capacity:
            self._waiting.popleft()
            self._live.n_unstored += 1
        self._alarms += findings.alarms
        while len(self._alarms) > MAX_NEWS:
            self._alarms.popleft()
            self._live.n_unstored += 1
        self._news.set()

    async def stored(self) -> None:
        """Wait until all news of alarms that there is now is on the disk, however long it takes."""
        mine = self._alarms[-1] if self._alarms else None
        async with self._progress:
            await self._progress.wait_for(lambda: all(news is not mine for news in self._alarms))

    async def reached(self, position: StreamPosition) -> None:
        """Wait until a position that was put is on the disk, however long it takes."""
        async with self._progress:
            await self._progress.wait_for(
                lambda: all(findings.position is not position for findings in self._waiting)
            )

    async def require_store(self) -> None:
        """See whether something could be written now, by a transaction without anything in it.

        Raises
        ------
        StoreError
            If not.
        """
        loop = asyncio.get_running_loop()
        await loop.run_in_executor(self._thread, self._store.append, [], [])

    async def settled(self) -> None:
        """Wait until everything is on the disk, or the store has refused to take it."""
        async with self._progress:
            await self._progress.wait_for(
                lambda: self._live.store_error or not (self._waiting or self._alarms)
            )

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Write whatever is queued, for ever."""
        while True:
            pulse.rest()
            await self._news.wait()
            self._news.clear()
            while self._waiting or self._alarms:
                pulse.beat(RETRY_S)
                if not await self._write():
                    await self._clock.sleep(RETRY_S)

    async def flush(self) -> None:
        """Write what is queued now, once; used at the end."""
        if (self._waiting or self._alarms) and not await self._write():
            log.error(
                "results are lost", n_findings=len(self._waiting), n_alarm_news=len(self._alarms)
            )

    async def _write(self) -> bool:
        batch, alarms = list(self._waiting), list(self._alarms)
        assessments = [a for findings in batch for a in findings.assessments]
        gaps = [gap for findings in batch for gap in findings.gaps]
        films = [told for findings in batch for told in findings.films]
        positions = [findings.position for findings in batch if findings.position]
        append = partial(self._append, assessments, gaps, alarms, films, positions)
        try:
            await asyncio.get_running_loop().run_in_executor(self._thread, append)
        except StoreError as error:
            if self._live.store_error is None:
                log.error("results are not being stored", reason=str(error))
            self._live.store_error = str(error)
            await self._tell_progress()
            return False
        if self._live.store_error is not None:
            log.info("results are being stored again")
        self._live.store_error = None
        self._waits_since_s = self._clock.monotonic_s()
        _drop(self._waiting, batch)
        _drop(self._alarms, alarms)
        if alarms:
            self._told()
        await self._tell_progress()
        return True

    def _append(
        self,
        assessments: Sequence[Assessment],
        gaps: Sequence[UnitGap],
        alarms: Sequence[AlarmNews],
        films: Sequence[FilmNews],
        positions: Sequence[StreamPosition],
    ) -> None:
        with self._timed():
            self._store.append(assessments, gaps, alarms, films, positions)

    async def _tell_progress(self) -> None:
        async with self._progress:
            self._progress.notify_all()


def _drop(queue: deque[T], written: Sequence[T]) -> None:
    """Take off the queue what has been written, and nothing that has come since."""
    ids = {id(entry) for entry in written}
    while queue and id(queue[0]) in ids:
        queue.popleft()
