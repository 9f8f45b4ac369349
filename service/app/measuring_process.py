"""Analysis part of a process, which makes results, alarms, evidence and messages from blocks."""

import asyncio
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from prometheus_client.process_collector import ProcessCollector

from acquisition.clock import Clock
from core.alarms.alarm import AlarmNews
from core.monitor.monitor import UnitMonitor
from core.samples.blocks import SampleBlock
from service.app import kept_files
from service.app.notifications import receivers_of
from service.app.service_health import Pressure, health_of
from service.cluster.measuring_side import CommandWorker, Reporter, process_name
from service.live.metrics import add_alarms, add_films, add_units
from service.live.references import ReferencesInForce
from service.live.snapshot import CaptureStatus, PlantSnapshot, SourceCounts
from service.measuring.acquirer import Bus
from service.measuring.alarm_engine import WHOLE, AlarmEngine, PlantPart, alarm_engine
from service.measuring.analyser import NO_MEMORIES, Analyser, UnitMemory
from service.measuring.commands import CommandExecutor
from service.measuring.films import FilmMonitor, film_monitor
from service.measuring.integrity import IntegrityMonitor
from service.measuring.live_view import LiveView
from service.measuring.metrics import add_disks, add_integrity, add_samples, add_store
from service.measuring.recorder import FILE, ParkedRows, Recorder
from service.measuring.service_alarms import StreamStatus
from service.measuring.snapshots import SnapshotBuilder
from service.measuring.sources import vector_rows
from service.notifications.message import LiveContext
from service.notifications.metrics import add_deliveries
from service.notifications.sender import Deliveries
from service.recordings.around_alarms import Captures
from service.recordings.continuous_recorder import ContinuousRecorder
from service.recordings.keeper import RecordingIndexer
from service.recordings.metrics import add_recordings
from service.reports.collector import EvidenceCollector
from service.runtime.disk import SpaceWatch
from service.runtime.heartbeats import Heartbeats, Loop, Pulse
from service.runtime.metrics import Families
from service.runtime.polls import TimedSource
from service.settings.plant import PlantFile
from service.settings.storage import Origin
from service.store.loops import RetentionLoop, RollupLoop, ScrubLoop
from service.store.port import StoreError
from service.store.retention import ages_of
from service.store.store import Store


@dataclass(frozen=True)
class ProcessContext:
    """Context of one process: plant, store, live view and heartbeats.

    `origin` is the origin, live or replay, of the data in the store and in all API responses;
    `beats` are the heartbeats of all loops of the process.
    """

    plant: PlantFile
    origin: Origin
    clock: Clock
    store: Store
    live: LiveView
    beats: Heartbeats


@dataclass(frozen=True)
class Analysis:
    """Parts of the analysis and the background services of a process.

    The caller passes blocks to `analyser`, runs `recorder` and the loops of `own_loops` and
    `shared_loops`, and finally calls `close`.
    """

    process: ProcessContext
    analyser: Analyser
    recorder: Recorder
    deliveries: Deliveries
    captures: Captures
    tape: ContinuousRecorder
    recordings: RecordingIndexer
    alarms: AlarmEngine
    films: FilmMonitor
    evidence: EvidenceCollector
    references: ReferencesInForce
    rolling: RollupLoop
    retaining: RetentionLoop
    space: SpaceWatch
    soundness: IntegrityMonitor
    executor: CommandExecutor
    snapshots: SnapshotBuilder

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
        if self.process.origin is Origin.LIVE:  # replayed data are not part of the machine history
            loops |= {"learn": self.films.run, "recordings": self.recordings.run}
        return loops

    @property
    def shared_loops(self) -> dict[str, Loop]:
        """Loops for the whole plant, by name; only one process runs them."""
        loops: dict[str, Loop] = {"gather": self.rolling.run, "deliver": self._deliver}
        if self.process.origin is Origin.LIVE:
            loops["retain"] = self.retaining.run
            loops["scrub"] = ScrubLoop(self.process.store.integrity, self.process.clock).run
        return loops

    async def _deliver(self, pulse: Pulse) -> None:
        pulse.rest()  # each sender has its own heartbeat
        await self.deliveries.run(self.process.beats)
        await asyncio.Event().wait()  # without receivers the loop only waits

    async def close(self) -> None:
        """Write all pending data; also called after an unexpected exception."""
        await self.captures.close()
        await self.recorder.flush()
        await self.evidence.close()
        await self.tape.close()
        self.recordings.close()


async def analysis_on(
    process: ProcessContext,
    monitors: Mapping[str, UnitMonitor],
    bus: Bus,
    alarm_context: LiveContext,
    part: PlantPart = WHOLE,
    memories: Mapping[str, UnitMemory] = NO_MEMORIES,
    stream: StreamStatus | None = None,
) -> Analysis:
    """Build the parts of the analysis, and restore their stored state.

    Raises `StoreError` if stored state cannot be read; a start without the state would lose it.

    Parameters
    ----------
    process, monitors
        Context of this process, and the monitor of each of its units by unit id.
    bus
        Queue of the blocks that wait for the analysis.
    alarm_context
        Context from which alarm messages take values; this function adds the newest films to it.
    part
        Part of the plant for which this process is responsible.
    memories
        Saved state by unit, only of units without missing samples since it was saved.
    stream
        Status of the stream; None if the blocks come directly from the sources.
    """
    plant, origin, store, clock = process.plant, process.origin, process.store, process.clock
    live = process.live
    soundness = IntegrityMonitor(store, clock, live)
    await soundness.look()  # before the first write
    if origin is Origin.LIVE:  # a replay starts without stored results and has no gap
        for unit, monitor in monitors.items():
            monitor.go_on(await asyncio.to_thread(store.reach, unit))
    deliveries = Deliveries(receivers_of(plant, origin, clock), store.outbox, clock)
    recorder = Recorder(
        store,
        live,
        clock,
        ParkedRows(Path(plant.service.data_folder) / FILE),
        on_stored=deliveries.wake,
        finds_again=stream is not None,
    )
    captures = kept_files.captures_of(plant, origin, clock)
    recordings = kept_files.waveform_keeper(plant, store, clock)
    pressure = Pressure(bus, recordings.is_full)
    tape = kept_files.tape_of(plant, origin, clock, pressure.look)
    space = kept_files.space_watch(plant, clock)
    look = health_of(
        monitors, live, recorder, captures, bus, space, tape, recordings, soundness, stream
    )

    def listen(block: SampleBlock, news: Sequence[AlarmNews]) -> None:
        captures.take(block, news)
        tape.take(block)

    alarms = await alarm_engine(
        plant,
        origin,
        store,
        recorder.put,
        clock,
        listen,
        vector_rows(plant),
        look,
        part,
        {unit: memory.alarms for unit, memory in memories.items()},
    )
    machines = {unit: monitor.unit for unit, monitor in monitors.items()}
    films = await film_monitor(plant, machines, store.films, clock)
    for unit, memory in memories.items():
        films.resume(unit, memory.films)
    alarm_context.watch_films(films.newest)
    evidence = kept_files.evidence_of(plant, origin, live, films, store, captures, clock)
    kept_files.watch(evidence, alarms, captures, origin)
    references = ReferencesInForce(
        *(machines.values(), store, clock),
        on_change=lambda unit: monitors[unit.id].replace_description(unit),
    )
    await references.look()  # before the first result
    return Analysis(
        process=process,
        analyser=Analyser(monitors, live, recorder, alarms, films),
        recorder=recorder,
        deliveries=deliveries,
        captures=captures,
        tape=tape,
        recordings=recordings,
        alarms=alarms,
        films=films,
        evidence=evidence,
        references=references,
        rolling=RollupLoop(store.rollups, clock),
        retaining=RetentionLoop(store.retention, ages_of(plant.retention), clock),
        space=space,
        soundness=soundness,
        executor=CommandExecutor(alarms, films, live, recorder, store, clock),
        snapshots=SnapshotBuilder(plant.unit, live, alarms, films, clock),
    )


def plant_snapshot(analysis: Analysis, sources: Mapping[str, TimedSource]) -> PlantSnapshot:
    """Return the present state of the measuring process; `sources` are its sources by unit id."""
    captures, deliveries = analysis.captures, analysis.deliveries
    return PlantSnapshot(
        loops=dict(analysis.process.beats.look()),
        checks={
            "disk": str(analysis.space),
            "stored data": analysis.soundness.trouble or "ok",
        },
        audit_error=analysis.process.store.audit.head_error,
        captures=CaptureStatus(captures.trouble, captures.error, captures.being_made),
        evidence=analysis.evidence.status,
        continuous=tuple(analysis.tape.units),
        continuous_trouble=analysis.tape.trouble,
        faults=dict(analysis.recordings.faults),
        receivers=deliveries.statuses,
        sources={unit: counts_of(source) for unit, source in sources.items()},
    )


def counts_of(source: TimedSource) -> SourceCounts:
    """Return the counts of polls and refused frames of a sample source."""
    found, refused = source.statistics, dict(source.refused_frames)
    if found is None:
        return SourceCounts(0, None, None, refused)
    return SourceCounts(found.n, found.newest_s, found.mean_s, refused)


def reporting_loops(analysis: Analysis, held: Callable[[], Collection[str]]) -> Mapping[str, Loop]:
    """Return the loops that report the state of units and execute operators' commands, by name.

    `held` returns the units of this process, also `PLANT` if it reports alarms without a unit,
    `SHARED` if it runs the plant-wide tasks.
    """
    process, name = analysis.process, process_name()
    store, clock = process.store, process.clock
    reporter = Reporter(name, held, analysis.snapshots, store.unit_states, clock)
    carrying_out = CommandWorker(name, held, analysis.executor, store, clock)
    return {"report": reporter.run, "commands": carrying_out.run}


async def measuring_metrics(
    analysis: Analysis, bus: Bus, sources: Mapping[str, TimedSource]
) -> bytes:
    """Return all metrics of the measuring process in the Prometheus text format.

    `sources` are the timed sample sources by unit id.
    """
    try:
        receivers = await analysis.deliveries.look()
    except StoreError:
        receivers = None
    process, families = analysis.process, Families()
    live, now_ns = process.live, process.clock.now_ns()
    units = {unit.id: [bearing.id for bearing in unit.bearing] for unit in process.plant.unit}
    families.add_program(process.store.kind)
    add_samples(families, live, units, sources, now_ns)
    add_units(families, live, units)
    add_films(families, live, analysis.films.newest, units)
    add_alarms(families, analysis.alarms.alarms, analysis.alarms.count(), list(units))
    add_store(families, bus, analysis.recorder, live)
    add_integrity(families, analysis.soundness)
    add_disks(families, analysis.space)
    add_recordings(families, analysis.tape, analysis.captures, analysis.recordings)
    add_evidence(families, analysis.evidence)
    add_deliveries(families, receivers, now_ns)
    families.include(ProcessCollector(registry=None))
    return families.text


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
