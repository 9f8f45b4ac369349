"""Findings on their way to the disk: in order, in batches, retried, never in the way."""

import asyncio
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import structlog

from acquisition.clock import Clock
from core.assessment import Assessment
from service.live import LiveView
from service.store.port import Store, StoreError, UnitGap

log = structlog.get_logger()

RETRY_S = 1.0


@dataclass(frozen=True)
class Findings:
    """What one block has taught: to be stored together or not at all."""

    assessments: Sequence[Assessment]
    gaps: Sequence[UnitGap]


class Recorder:
    """Writes findings to the store in a thread, so that a slow disk delays no samples.

    Parameters
    ----------
    capacity
        Most findings that wait for a store that does not answer; beyond it the oldest are given up
        and counted in :attr:`LiveView.n_unstored`.
    """

    def __init__(self, store: Store, live: LiveView, clock: Clock, capacity: int = 5000) -> None:
        self._store, self._live, self._clock = store, live, clock
        self._capacity = capacity
        self._waiting: deque[Findings] = deque()
        self._news = asyncio.Event()

    def put(self, findings: Findings) -> None:
        """Queue findings."""
        if len(self._waiting) >= self._capacity:
            self._waiting.popleft()
            self._live.n_unstored += 1
        self._waiting.append(findings)
        self._news.set()

    async def run(self) -> None:
        """Write whatever is queued, for ever."""
        while True:
            await self._news.wait()
            self._news.clear()
            while self._waiting:
                if not await self._write():
                    await self._clock.sleep(RETRY_S)

    async def flush(self) -> None:
        """Write what is queued now, once; used at the end."""
        if self._waiting and not await self._write():
            log.error("results are lost", n_findings=len(self._waiting))

    async def _write(self) -> bool:
        batch = list(self._waiting)
        assessments = [a for findings in batch for a in findings.assessments]
        gaps = [gap for findings in batch for gap in findings.gaps]
        try:
            await asyncio.to_thread(self._store.append, assessments, gaps)
        except StoreError as error:
            if self._live.store_error is None:
                log.error("results are not being stored", reason=str(error))
            self._live.store_error = str(error)
            return False
        if self._live.store_error is not None:
            log.info("results are being stored again")
        self._live.store_error = None
        written = {id(findings) for findings in batch}
        while self._waiting and id(self._waiting[0]) in written:
            self._waiting.popleft()
        return True
