"""Analysis part of a process: results, alarms, evidence and messages from sample blocks."""

import asyncio
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from core.alarms.alarm import AlarmNews
from core.monitor.monitor import UnitMonitor
from core.samples.blocks import SampleBlock
from service.api.load import LoadWatch
from service.app.notifications import receivers_of
from service.app.process import ProcessContext, start_loops
from service.app.service_health import Pressure, health_of
from service.app.storage import (
    captures_of,
    evidence_of,
    space_watch,
    tape_of,
    watch,
    waveform_keeper,
)
from service.cluster.reported_commands import CommandWorker
from service.cluster.reported_state import Reporter, process_name
from service.measuring.acquirer import Bus
from service.measuring.alarm_engine import WHOLE, AlarmEngine, PlantPart, alarm_engine
from service.measuring.analyser import NO_MEMORIES, Analyser, UnitMemory
from service.measuring.films import FilmMonitor, film_monitor
from service.measuring.integrity import IntegrityMonitor
from service.measuring.recorder import FILE, ParkedRows, Recorder
from service.measuring.references import ReferencesInForce
from service.measuring.service_alarms import StreamStatus
from service.measuring.sources import vector_rows
from service.notifications.message import LiveContext
from service.notifications.sender import Deliveries
from service.recordings.around_alarms import Captures
from service.recordings.continuous_recorder import ContinuousRecorder
from service.recordings.keeper import RecordingIndexer
from service.reports.collector import EvidenceCollector
from service.runtime.disk import SpaceWatch
from service.runtime.heartbeats import Loop
from service.settings.storage import Origin
from service.store.loops import RetentionLoop, RollupLoop, ScrubLoop
from service.store.retention import ages_of


@dataclass(frozen=True)
class Analysis:
    """Parts of the analysis; the caller passes blocks to `analyser` and runs `recorder`."""

    process: ProcessContext
    part: PlantPart
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
    load: LoadWatch
    soundness: IntegrityMonitor

    def start(self, tasks: asyncio.TaskGroup) -> list[asyncio.Task[None]]:
        """Start the background loops; they run until they are cancelled."""
        beats, loops = self.process.beats, self.own_loops
        if self.part != WHOLE:
            return start_loops(loops, beats, tasks)
        # the only process of the plant
        begun = start_loops(loops | self.shared_loops, beats, tasks)
        return [*begun, tasks.create_task(self.deliveries.run(beats), name="deliver")]

    @property
    def own_loops(self) -> dict[str, Loop]:
        """Loops that every process runs for its own units."""
        loops: dict[str, Loop] = {
            "references": self.references.run,
            "alarms": self.alarms.run,
            "captures": self.captures.run,
            "tape": self.tape.run,
            "evidence": self.evidence.run,
            "space": self.space.run,
            "load": self.load.run,
            "soundness": self.soundness.run,
        }
        if self.process.origin is Origin.LIVE:  # replayed data are not part of the machine history
            loops |= {"learn": self.films.run, "recordings": self.recordings.run}
        return loops

    @property
    def shared_loops(self) -> dict[str, Loop]:
        """Loops that only one process runs for the plant, without the delivery of messages."""
        loops: dict[str, Loop] = {"gather": self.rolling.run}
        if self.process.origin is Origin.LIVE:
            loops["retain"] = self.retaining.run
            loops["scrub"] = ScrubLoop(self.process.store.integrity, self.process.clock).run
        return loops

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
    """Build the parts of the analysis; resume from the stored state.

    Parameters
    ----------
    bus
        Queue of blocks to the analysis.
    alarm_context
        Source of the values in alarm messages; receives the newest films.
    part
        Part of the plant for which this process is responsible.
    memories
        Saved state of the units whose samples have no gap since it was saved.
    stream
        Status of the stream; None if the blocks come directly from the sources.

    Raises
    ------
    StoreError
        If stored state cannot be read; a start without the state would lose it.
    """
    plant, origin, store, clock = process.plant, process.origin, process.store, process.clock
    live = process.live
    soundness = IntegrityMonitor(store, clock, live)
    await soundness.look()  # before the first write
    if origin is Origin.LIVE:  # a replay starts without stored results and has no gap
        for unit, monitor in monitors.items():
            monitor.go_on(await asyncio.to_thread(store.reach, unit))
    deliveries = Deliveries(receivers_of(plant, origin, clock), store.outbox, clock)
    commits = process.timings.commits
    recorder = Recorder(
        store,
        live,
        clock,
        ParkedRows(Path(plant.service.data_folder) / FILE),
        on_stored=deliveries.wake,
        timed=commits.timed,
        finds_again=stream is not None,
    )
    captures = captures_of(plant, origin, clock)
    recordings = waveform_keeper(plant, store, clock)
    load = LoadWatch(bus, clock)
    pressure = Pressure(bus, recordings.is_full, lambda: bool(load.refused))
    tape = tape_of(plant, origin, clock, pressure.look)
    space = space_watch(plant, clock)
    look = health_of(
        monitors, live, recorder, captures, bus, space, load, tape, recordings, soundness, stream
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
    evidence = evidence_of(plant, origin, live, films, store, captures, clock)
    watch(evidence, alarms, captures, origin)
    references = ReferencesInForce(monitors, store, clock)
    await references.look()  # before the first result
    return Analysis(
        process=process,
        part=part,
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
        load=load,
        soundness=soundness,
    )


def reporting_loops(analysis: Analysis, held: Callable[[], Collection[str]]) -> Mapping[str, Loop]:
    """Return the loops that publish the state of units and carry out operators' commands.

    Parameters
    ----------
    held
        Returns the units of this process; `PLANT` if it also publishes alarms without a unit, and
        `SHARED` if it does the shared work.
    """
    process, name = analysis.process, process_name()
    store, parts = process.store, (analysis.alarms, analysis.films)
    reporter = Reporter(
        name, process.plant.unit, held, process.live, *parts, store.unit_states, process.clock
    )
    carrying_out = CommandWorker(name, held, *parts, analysis.recorder, store, process.clock)
    return {"report": reporter.run, "commands": carrying_out.run}
