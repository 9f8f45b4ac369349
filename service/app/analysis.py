"""Analysis part of a process, which makes results, alarms, evidence and messages from blocks."""

import asyncio
import os
import socket
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING
from uuid import uuid4

from prometheus_client.process_collector import ProcessCollector

from acquisition.clock import Clock
from core.alarms.alarm import AlarmNews
from core.monitor.monitor import UnitMonitor
from core.samples.blocks import SampleBlock
from service.app import kept_files
from service.app.notifications import receivers_of, router_of
from service.app.storage import open_store
from service.cluster.measuring_side import CommandWorker, Reporter
from service.live.references import ReferencesInForce
from service.live.snapshot import CaptureStatus, PlantSnapshot, SourceCounts
from service.measuring.acquirer import Bus
from service.measuring.alarm_engine import WHOLE, PlantPart, alarm_engine
from service.measuring.analyser import BUS_CAPACITY, Analyser, UnitMemory
from service.measuring.commands import CommandExecutor
from service.measuring.films import film_monitor
from service.measuring.integrity import IntegrityMonitor
from service.measuring.live_view import LiveView
from service.measuring.metrics import add_disks, add_integrity, add_samples, add_store
from service.measuring.recorder import Recorder
from service.measuring.service_alarms import ServiceHealth
from service.measuring.snapshots import Reports
from service.measuring.sources import monitor_of
from service.notifications.message import LiveContext
from service.notifications.metrics import add_deliveries
from service.notifications.sender import Deliveries
from service.recordings.continuous_recorder import DropReason
from service.recordings.metrics import add_recordings
from service.reports.collector import EvidenceCollector
from service.runtime.heartbeats import Heartbeats, Loop, Pulse
from service.runtime.metrics import Families
from service.runtime.polls import TimedSource
from service.settings.core_values import stale_after_s
from service.settings.plant import PlantFile
from service.settings.storage import Origin
from service.store.loops import RetentionLoop, RollupLoop, ScrubLoop
from service.store.port import StoreError
from service.store.retention import ages_of
from service.store.store import Store

if TYPE_CHECKING:
    from service.cluster.consumer import Consumer  # slow import, only with a stream


APART_S = 0.12
"""Time between the first segments of one unit and the next, s: with 100 units, results are spread
evenly over the 12 s from one segment to the next."""


@dataclass(eq=False)
class Analysis:
    """Parts of the analysis and the background services of a process.

    The caller awaits `start`, passes blocks to `analyser`, runs `recorder` and the loops of
    `own_loops` and `shared_loops`, and finally calls `close`.

    Parameters
    ----------
    plant, monitors
        Plant file with the units of this process, and the monitor of each by unit id.
    origin
        Origin, live or replay, of the data in the store and in all API responses.
    part
        Part of the plant for which this process is responsible.
    sources
        Timed sources by unit id; empty if blocks come over a stream.

    Attributes
    ----------
    beats
        Heartbeats of all loops of the process.
    bus
        Queue of the blocks that wait for the analysis; always empty with a stream.
    stream
        Consumer of the stream; None before it is started, and without a stream.
    """

    plant: PlantFile
    origin: Origin
    clock: Clock
    store: Store
    live: LiveView
    alarm_context: LiveContext
    monitors: Mapping[str, UnitMonitor]
    part: PlantPart = WHOLE
    sources: Mapping[str, TimedSource] = field(default_factory=dict)
    stream: "Consumer | None" = field(default=None, init=False)

    def __post_init__(self) -> None:
        plant, origin, store, clock = self.plant, self.origin, self.store, self.clock
        self.beats, self.bus = Heartbeats(clock), Bus(BUS_CAPACITY, clock)
        self.soundness = IntegrityMonitor(store, clock, self.live)
        self.deliveries = Deliveries(receivers_of(plant, origin, clock), store.outbox, clock)
        parts = (store, self.live, clock, Path(plant.service.data_folder))
        wake = self.deliveries.wake
        self.recorder = Recorder(*parts, on_stored=wake, finds_again=self.part != WHOLE)
        self.captures = kept_files.captures_of(plant, origin, clock)
        self.recordings = kept_files.waveform_keeper(plant, store, clock)
        pressure = Pressure(self.bus, self.recordings.is_full)
        self.tape = kept_files.tape_of(plant, origin, clock, pressure.look)
        self.space = kept_files.space_watch(plant, clock)
        self.references = ReferencesInForce(
            *([monitor.unit for monitor in self.monitors.values()], store, clock),
            on_change=lambda unit: self.monitors[unit.id].replace_description(unit),
        )

    async def start(self, memories: Mapping[str, UnitMemory] = MappingProxyType({})) -> None:
        """Restore the stored state, before the first block.

        `memories` are saved states by unit, only of units without missing samples since they were
        saved. Raises `StoreError` if stored state cannot be read; a start without it would lose it.
        """
        plant, origin, store, clock = self.plant, self.origin, self.store, self.clock
        live, recorder, monitors = self.live, self.recorder, self.monitors
        await self.soundness.look()  # before the first write
        if origin is Origin.LIVE:  # a replay starts without stored results and has no gap
            for number, (unit, monitor) in enumerate(monitors.items()):
                n_held = round(number * APART_S * monitor.unit.rate_hz)
                monitor.go_on(await asyncio.to_thread(store.reach, unit), n_held)
        self.alarms = alarms = await alarm_engine(
            *(plant, origin, store, recorder.put, clock, self._listen),
            *(self.health, self.part, {unit: memory.alarms for unit, memory in memories.items()}),
        )
        machines = {unit: monitor.unit for unit, monitor in monitors.items()}
        self.films = films = await film_monitor(plant, machines, store.films, clock)
        for unit, memory in memories.items():
            films.resume(unit, memory.films)
        self.alarm_context.watch_films(films.newest)
        captures = self.captures
        self.evidence = kept_files.evidence_of(plant, origin, live, films, store, captures, clock)
        if origin is Origin.LIVE:  # a replay collects no evidence
            alarms.set_observer(self.evidence.see)
            captures.set_listener(self.evidence.captured)
        await self.references.look()  # before the first result
        self.analyser = Analyser(monitors, live, alarms, films)
        self.executor = CommandExecutor(alarms, films, live, recorder, store, clock)

    def _listen(self, block: SampleBlock, news: Sequence[AlarmNews]) -> None:
        self.captures.take(block, news)
        self.tape.take(block)

    @property
    def own_loops(self) -> dict[str, Loop]:
        """Loops that every process runs for its own units, by name."""
        loops: dict[str, Loop] = {
            "references": self.references.run,
            "alarms": self.alarms.run,
            "captures": self.captures.run,
            "tape": self.tape.run,
            "evidence": self.evidence.run,
            "space": self.space.run,
            "soundness": self.soundness.run,
        }
        if self.origin is Origin.LIVE:  # replayed data are not part of the machine history
            loops |= {"learn": self.films.run, "recordings": self.recordings.run}
        return loops

    @property
    def shared_loops(self) -> dict[str, Loop]:
        """Loops for the whole plant, by name; only one process runs them."""
        store, clock = self.store, self.clock
        rolling = RollupLoop(store.rollups, clock)
        loops: dict[str, Loop] = {"gather": rolling.run, "deliver": self._deliver}
        if self.origin is Origin.LIVE:
            ages = ages_of(self.plant.retention)
            loops["retain"] = RetentionLoop(store.retention, ages, clock).run
            loops["scrub"] = ScrubLoop(store.integrity, clock).run
        return loops

    def reporting_loops(self, held: Callable[[], Collection[str]]) -> dict[str, Loop]:
        """Return the loops that report the state of units and execute commands, by name.

        `held` returns the units of this process, also `PLANT` if it reports alarms without a unit,
        `SHARED` if it runs the plant-wide tasks.
        """
        name = f"{socket.gethostname()}:{os.getpid()}:{uuid4().hex[:12]}"
        store, clock = self.store, self.clock
        parts = (self.plant.unit, self.live, self.alarms, self.films)
        reporter = Reporter(Reports(name, held, *parts), store.unit_states, clock)
        commands = CommandWorker(name, held, self.executor, store, clock)
        return {"report": reporter.run, "commands": commands.run}

    async def _deliver(self, pulse: Pulse) -> None:
        pulse.rest()  # each sender has its own heartbeat
        await self.deliveries.run(self.beats)
        await asyncio.Event().wait()  # without receivers the loop only waits

    async def close(self) -> None:
        """Write all pending data; also called after an unexpected exception."""
        await self.captures.close()
        await self.recorder.flush()
        await self.evidence.close()
        await self.tape.close()
        self.recordings.close()

    @property
    def recording_error(self) -> str | None:
        """Error of the continuous recorder or of the indexer; None without an error."""
        return self.tape.trouble or self.recordings.lasting_trouble

    def health(self) -> ServiceHealth:
        """Return the present health of the service, for its alarms."""
        live, bus, stream = self.live, self.bus, self.stream
        found = {unit: live.status(unit) for unit in self.monitors}
        return ServiceHealth(
            store_error=live.store_error,
            store_behind_s=self.recorder.behind_s,
            n_unstored=live.n_unstored,
            unstored_reason=live.unstored_reason,
            n_recordings_damaged=self.recordings.n_lost,
            readings={
                "waiting_share": bus.qsize() / bus.maxsize,
                "analysis_delay_s": max(bus.oldest_wait_s, stream.behind_s if stream else 0.0),
                "captures_error": self.captures.trouble,
                "recording_error": self.recording_error,
                "stored_trouble": self.soundness.trouble,
                "stream_trouble": stream.trouble if stream else None,
            },
            accounts={u: s.account for u, s in found.items() if s.last_sample_ns is not None},
            disk=self.space.condition,
        )

    def snapshot(self) -> PlantSnapshot:
        """Return the present state of this process."""
        captures = self.captures
        return PlantSnapshot(
            loops=dict(self.beats.look()),
            checks={"disk": str(self.space), "stored data": self.soundness.trouble or "ok"},
            audit_error=self.store.audit.head_error,
            captures=CaptureStatus(captures.trouble, captures.error, captures.being_made),
            evidence=self.evidence.status,
            continuous=tuple(self.tape.units),
            continuous_trouble=self.tape.trouble,
            faults=dict(self.recordings.faults),
            receivers=self.deliveries.statuses,
            sources={
                unit: SourceCounts(source.statistics, dict(source.refused_frames))
                for unit, source in self.sources.items()
            },
        )

    async def metrics(self) -> bytes:
        """Return the metrics of this process in the Prometheus text format.

        The serving process adds those of units, films and alarms.
        """
        try:
            receivers = await self.deliveries.look()
        except StoreError:
            receivers = None
        families, live, now_ns = Families(), self.live, self.clock.now_ns()
        families.add_program(self.store.kind)
        add_samples(families, live, self.monitors, self.sources, now_ns)
        add_store(families, self.bus, self.recorder, live)
        add_integrity(families, self.soundness)
        add_disks(families, self.space)
        add_recordings(families, self.tape, self.captures, self.recordings)
        add_evidence(families, self.evidence)
        add_deliveries(families, receivers, now_ns)
        families.include(ProcessCollector(registry=None))
        return families.text


@contextmanager
def opened_analysis(
    plant: PlantFile,
    origin: Origin,
    clock: Clock,
    part: PlantPart = WHOLE,
    sources: Mapping[str, TimedSource] = MappingProxyType({}),
) -> Iterator[Analysis]:
    """Open the store of a process for its analysis; raise `StoreError` if it cannot be used."""
    monitors = {unit.id: monitor_of(unit, plant.analysis) for unit in plant.unit}
    live = LiveView(monitors, clock, stale_after_s(plant))
    context = LiveContext(live.assessment)
    router = router_of(plant, origin, context, clock)
    with closing(open_store(plant, origin, router)) as store:
        yield Analysis(plant, origin, clock, store, live, context, monitors, part, sources)


EVIDENCE = {
    "evidence_written_total": "This counts the bundles of evidence of alarms.",
    "evidence_failed_total": "This counts the failed attempts to write such a bundle.",
    "evidence_lost_total": "This counts the occurrences whose evidence was given up.",
    "evidence_pending": "This is the number of bundles that are still to be written.",
}


def add_evidence(families: Families, evidence: EvidenceCollector) -> None:
    """Add the numbers of stored and failed evidence bundles."""
    families.declare(EVIDENCE)
    families.add("evidence_written_total", evidence.n_written)
    families.add("evidence_failed_total", evidence.n_failed)
    families.add("evidence_lost_total", evidence.n_lost)
    families.add("evidence_pending", evidence.n_pending)


BEHIND_S = 3.0
"""Waiting time of a block, s, above which recording pauses; the analysis has priority."""

BEHIND_SHARE = 0.25
"""Filled share of the block queue above which recording pauses."""

CAUGHT_UP = 1.0 / 3.0
"""Share of `BEHIND_S` and `BEHIND_SHARE` below which recording resumes."""


class Pressure:
    """Control that pauses recording while the analysis is behind or the disk is nearly full.

    `is_full` returns whether the disk is nearly full.
    """

    def __init__(self, bus: Bus, is_full: Callable[[], bool]) -> None:
        self._bus, self._is_full = bus, is_full
        self._is_behind = False

    def look(self) -> DropReason | None:
        """Return the reason why recording must pause now; None if it may continue."""
        share = CAUGHT_UP if self._is_behind else 1.0
        self._is_behind = (
            self._bus.oldest_wait_s > share * BEHIND_S
            or self._bus.qsize() > share * BEHIND_SHARE * self._bus.maxsize
        )
        if self._is_behind:
            return DropReason.ANALYSIS_BEHIND
        return DropReason.DISK_FULL if self._is_full() else None
