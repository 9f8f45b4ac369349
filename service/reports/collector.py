"""Evidence collector: writes a bundle for each occurrence of an alarm in the background."""

import asyncio
import os
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import structlog

from acquisition.clock import Clock
from core.alarms.alarm import ANNOUNCED, AlarmEvent, AlarmNews
from service.live.snapshot import EvidenceStatus
from service.measuring.films import FilmMonitor
from service.measuring.live_view import LiveView
from service.recordings.around_alarms import Captures, Outcome
from service.reports.folders import (
    EvidenceFolders,
    clear_leftovers,
    link,
    link_all,
    note_beginning,
    note_lost,
    place_of,
)
from service.reports.retention import EvidenceRetention
from service.reports.snapshot import BearingSnapshot, Snapshot
from service.reports.writer import EvidenceWriter
from service.runtime.files import write_whole
from service.runtime.heartbeats import UNHEARD, Pulse
from service.settings.bearings import CHANNEL_KEYS, GAP_KEYS, OPTIONAL_CHANNEL_KEYS
from service.settings.configuration import Configuration
from service.settings.units import UnitSettings
from service.store.port import StoreError

log = structlog.get_logger()

RETRY_S = 10.0
"""Delay in seconds before a failed write is repeated."""

MAX_BUSY_S = 300.0
"""Maximum time in seconds to write a bundle, or to survey all bundles."""

MAX_PENDING = 200
"""Maximum number of queued snapshots; each takes a few hundred kilobytes of memory."""

STORE_ATTEMPTS = 5
"""Number of attempts after which a bundle is written without data from the store."""


class SnapshotTaker:
    """Source of snapshots, which copy only references, so that the event loop is not blocked."""

    def __init__(
        self, units: Mapping[str, UnitSettings], live: LiveView, films: FilmMonitor
    ) -> None:
        self._units, self._live, self._films = units, live, films

    def take(self, event: AlarmEvent, now_ns: int, samples_expected: bool) -> Snapshot:
        """Return a snapshot of the unit of an alarm event, or of the event if it has no unit.

        ``now_ns`` is the time of the snapshot, ns since 1970 UTC; ``samples_expected`` states
        whether the samples around the alarm are to be recorded.
        """
        id_, unit = event.identity.unit, self._units.get(event.identity.unit)
        bearing = None if unit is None else _bearing_of(unit, event.identity.subject)
        ids = [] if unit is None else [each.id for each in unit.bearing]
        ids.sort(key=lambda each: each != bearing)  # stable: the others keep their order
        live, films = self._live, self._films
        return Snapshot(
            event=event,
            taken_ns=now_ns,
            status=None if unit is None else live.status(id_),
            bearings={
                each: BearingSnapshot(
                    live.assessment(id_, each), films.newest(id_, each), films.baseline(id_, each)
                )
                for each in ids
            },
            bearing=bearing,
            rules=films.rules(id_),
            samples_expected=samples_expected,
        )


def _bearing_of(unit: UnitSettings, subject: str) -> str | None:
    """Return the id of the bearing of an alarm subject: a bearing id or a channel of a bearing.

    A bearing that requires the channel takes precedence over a bearing for which it is optional.
    None if the subject belongs to no bearing.
    """
    for keys in (("id", *CHANNEL_KEYS), ("oil_temperature", *GAP_KEYS[:2], *OPTIONAL_CHANNEL_KEYS)):
        for bearing in unit.bearing:
            if subject in [getattr(bearing, key) for key in keys]:
                return bearing.id
    return None


class EvidenceCollector:
    """Collector of evidence: takes snapshots on the event loop, and writes them in its thread.

    ``captures`` reports which samples are recorded; ``room`` removes the oldest bundles.

    Attributes
    ----------
    error
        Error of the last attempt to write; None if it succeeded.
    n_written, n_failed, n_lost
        Numbers of written bundles, failed attempts and abandoned occurrences since the start.
    """

    def __init__(
        self,
        folders: EvidenceFolders,
        taker: SnapshotTaker,
        writer: EvidenceWriter,
        room: EvidenceRetention,
        configuration: Configuration,
        captures: Captures,
        clock: Clock,
    ) -> None:
        self._folders, self._taker, self._writer, self._room = folders, taker, writer, room
        self.configuration, self._captures, self._clock = configuration, captures, clock
        self._pending: deque[Snapshot] = deque()
        self._outcomes: deque[Outcome] = deque()
        self._news = asyncio.Event()
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="evidence")
        self._n_store_attempts = 0
        self.error: str | None = None
        self.n_written = self.n_failed = self.n_lost = 0

    @property
    def status(self) -> EvidenceStatus:
        """Unfinished bundles and captures."""
        return EvidenceStatus(self.pending, self.capturing)

    @property
    def n_pending(self) -> int:
        """Number of occurrences whose bundles are still to be written."""
        return len(self._pending)

    def see(self, news: Sequence[AlarmNews]) -> None:
        """Queue a snapshot for each alarm raised or escalated; drop the oldest beyond the limit."""
        for each in news:
            for event in each.events:
                if event.change in ANNOUNCED:
                    self._take(event)

    def captured(self, outcome: Outcome) -> None:
        """Queue the outcome of a capture, complete or lost, for the evidence of its alarms."""
        self._outcomes.append(outcome)
        self._news.set()

    @property
    def pending(self) -> frozenset[tuple[str, int]]:
        """Alarm id and occurrence of each bundle that is still to be written."""
        return frozenset((s.event.identity.id, s.event.occurrence) for s in self._pending)

    @property
    def capturing(self) -> frozenset[tuple[str, int]]:
        """Alarm id and occurrence of each capture that is still to be recorded or linked."""
        ended = (event for outcome in self._outcomes for event in outcome.alarms)
        linking = frozenset((event.identity.id, event.occurrence) for event in ended)
        return self._captures.being_made | linking

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Write bundles until cancelled, and retry after errors of disk or store.

        ``pulse`` receives a heartbeat before each write; call `close` afterwards.
        """
        pulse.beat(MAX_BUSY_S)
        await self._trying(self._begin)
        await self._trying(self._make_room)
        while True:
            pulse.rest()
            await self._news.wait()
            self._news.clear()
            while self._pending or self._outcomes:
                pulse.beat(MAX_BUSY_S)
                if not await self._write_one():
                    await self._clock.sleep(RETRY_S)
            pulse.beat(MAX_BUSY_S)
            await self._trying(self._make_room)

    async def close(self) -> None:
        """Write pending bundles until the first failure; log the number lost; stop the thread."""
        while self._pending or self._outcomes:
            if not await self._write_one():
                break
        if self._pending:
            log.error("evidence not written before the stop is lost", n_occurrences=self.n_pending)
        self._thread.shutdown(wait=False)

    def _take(self, event: AlarmEvent) -> None:
        expected = self._captures.expects(event)
        self._pending.append(self._taker.take(event, self._clock.now_ns(), expected))
        if len(self._pending) > MAX_PENDING:
            lost = self._pending.popleft()
            self.n_lost += 1
            log.error("evidence is lost: too many alarms wait for the disk", occurrence=lost.name)
        self._news.set()

    async def _write_one(self) -> bool:
        """Write the oldest pending bundle, else the oldest link; return whether it succeeded."""
        if self._pending:
            snapshot = self._pending[0]
            with_history = self._n_store_attempts < STORE_ATTEMPTS
            if not await self._trying(partial(self._write, snapshot, with_history)):
                return False
            self._n_store_attempts = 0
            if self._pending and self._pending[0] is snapshot:
                self._pending.popleft()
            return True
        outcome = self._outcomes[0]
        if not await self._trying(partial(self._link, outcome)):
            return False
        self._outcomes.popleft()
        return True

    def _write(self, snapshot: Snapshot, with_history: bool) -> None:
        _keep_configuration(self._folders.configurations, self.configuration)
        self._room.note(self._writer.write(snapshot, with_history=with_history))
        self.n_written += 1

    def _link(self, outcome: Outcome) -> None:
        """Write the links from bundles to their capture; runs in the thread."""
        for event in outcome.alarms:
            place = place_of(self._folders.evidence, event)
            if not place.folder.is_dir():
                continue
            if outcome.folder is None:
                note_lost(place.folder, outcome.reason or "no samples arrived")
            elif outcome.folder.is_dir():
                link(place.folder, outcome.folder)
            self._room.note(place)

    def _begin(self) -> None:
        """Write the configuration, remove unfinished bundles, add missing links; in the thread."""
        _keep_configuration(self._folders.configurations, self.configuration)
        note_beginning(self._folders.evidence, self._clock.now_ns())
        for folder in clear_leftovers(self._folders.evidence):
            log.warning("unfinished evidence was removed", folder=folder.name)
        link_all(self._folders.evidence, self._folders.captures)

    def _make_room(self) -> None:
        for name in self._room.make():
            log.info("evidence was removed to free space", folder=name)

    async def _trying(self, do: Callable[[], None]) -> bool:
        """Run a function in the thread; return whether it raised no error of disk or store."""
        try:
            await asyncio.get_running_loop().run_in_executor(self._thread, do)
        except (StoreError, OSError) as error:
            self._n_store_attempts += isinstance(error, StoreError)
            self.n_failed += 1
            if str(error) != self.error:
                log.error("the evidence of an alarm could not be written", reason=str(error))
            self.error = str(error)
            return False
        if self.error is not None:
            log.info("evidence of alarms is written again")
        self.error = None
        return True


def _keep_configuration(folder: Path, configuration: Configuration) -> None:
    """Write a configuration to a file named by its version, unless the file has this content.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    path = folder / f"{configuration.version}.json"
    if path.exists() and path.read_bytes() == configuration.text:
        return
    os.makedirs(folder, exist_ok=True)
    write_whole(path, configuration.text)
