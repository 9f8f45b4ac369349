"""`Analysis`: the parts that turn blocks into stored results, alarms, evidence and messages."""

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from core.alarms.alarm import AlarmNews
from core.monitor.monitor import UnitMonitor
from core.samples.blocks import SampleBlock
from service.api.load import LoadLimits, LoadWatch
from service.app.captures import captures_of
from service.app.delivery import receivers_of
from service.app.evidence import evidence_of, watch
from service.app.ground import Ground
from service.app.pressure import Pressure
from service.app.retention import retention_limits
from service.app.service_health import health_of
from service.app.space import space_watch
from service.app.tapes import tape_of
from service.app.waveforms import waveform_keeper
from service.measuring.alarms.engine import AlarmEngine
from service.measuring.alarms.health import StreamLook
from service.measuring.alarms.start import Listener, alarm_engine
from service.measuring.analysing import Analyser
from service.measuring.bus import Bus
from service.measuring.films.keeper import FilmKeeper
from service.measuring.films.start import film_keeper
from service.measuring.parked_rows import FILE, ParkedRows
from service.measuring.plant_part import WHOLE, PlantPart
from service.measuring.recorder import Recorder
from service.measuring.references import ReferencesInForce
from service.measuring.soundness import Soundness
from service.measuring.sources import vector_rows
from service.measuring.unit_memory import NO_MEMORIES, UnitMemory
from service.notifications.deliveries import Deliveries
from service.notifications.facts import Around
from service.recordings.capture.captures import Captures
from service.recordings.continuous.tape import Tape
from service.recordings.keeping.keeper import WaveformKeeper
from service.reports.keeper import EvidenceKeeper
from service.runtime.heartbeats import Loop
from service.runtime.space.watch import SpaceWatch
from service.settings.origin import Origin
from service.store.retaining import Retaining
from service.store.rolling import Rolling
from service.store.scrubbing import Scrubbing


@dataclass(frozen=True)
class Analysis:
    """All that analysing needs; whoever has it feeds `analyser`, and runs `recorder`."""

    ground: Ground
    part: PlantPart
    analyser: Analyser
    recorder: Recorder
    deliveries: Deliveries
    captures: Captures
    tape: Tape
    recordings: WaveformKeeper
    alarms: AlarmEngine
    films: FilmKeeper
    evidence: EvidenceKeeper
    references: ReferencesInForce
    rolling: Rolling
    retaining: Retaining
    space: SpaceWatch
    load: LoadWatch
    soundness: Soundness

    def start(self, tasks: asyncio.TaskGroup) -> list[asyncio.Task[None]]:
        """Begin the loops beside the blocks; they run until they are cancelled."""
        beats, loops = self.ground.beats, self.own_loops
        if self.part == WHOLE:  # there is nobody to share with
            loops = {**loops, **self.shared_loops}
        begun = [tasks.create_task(beats.tend(name, loops[name]), name=name) for name in loops]
        if self.part == WHOLE:
            begun.append(tasks.create_task(self.deliveries.run(beats), name="deliver"))
        return begun

    @property
    def own_loops(self) -> dict[str, Loop]:
        """What every process does for its own units."""
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
        if self.ground.origin is Origin.LIVE:  # what a replay shows is no history of a machine
            loops |= {"learn": self.films.run, "recordings": self.recordings.run}
        return loops

    @property
    def shared_loops(self) -> dict[str, Loop]:
        """What one process does for the whole plant, beside delivering messages."""
        loops: dict[str, Loop] = {"gather": self.rolling.run}
        if self.ground.origin is Origin.LIVE:
            loops["retain"] = self.retaining.run
            loops["scrub"] = Scrubbing(self.ground.store.integrity, self.ground.clock).run
        return loops

    async def close(self) -> None:
        """Write what is not written yet; also when a bug ends the program."""
        await self.captures.close()
        await self.recorder.flush()
        await self.evidence.close()
        await self.tape.close()
        self.recordings.close()


async def analysis_on(
    ground: Ground,
    monitors: Mapping[str, UnitMonitor],
    bus: Bus,
    around: Around,
    part: PlantPart = WHOLE,
    memories: Mapping[str, UnitMemory] = NO_MEMORIES,
    stream: StreamLook | None = None,
) -> Analysis:
    """Put the parts together, and let them go on where the service stopped.

    Parameters
    ----------
    bus
        Where blocks wait for the analysis.
    around
        Is shown the films, of which messages tell.
    part
        What of the plant this process looks after.
    memories
        What was known of units besides what is stored, where no sample is missing since.
    stream
        How blocks come over the stream, where they come that way.

    Raises
    ------
    StoreError
        If what is stored cannot be read: to begin without it would lose it.
    """
    plant, origin, store, clock = ground.plant, ground.origin, ground.store, ground.clock
    live = ground.live
    soundness = Soundness(store, clock, live)
    await soundness.look()  # before anything is written
    if origin is Origin.LIVE:  # a replay begins anew, and misses nothing
        for unit, monitor in monitors.items():
            monitor.go_on(await asyncio.to_thread(store.reach, unit))
    deliveries = Deliveries(receivers_of(plant, origin, clock), store.outbox, clock)
    commits = ground.timings.commits
    recorder = Recorder(
        store,
        live,
        clock,
        ParkedRows(Path(plant.service.data_folder) / FILE),
        told=deliveries.wake,
        timed=commits.timed,
        finds_again=stream is not None,
    )
    captures = captures_of(plant, origin, clock)
    recordings = waveform_keeper(plant, store, clock)
    load = LoadWatch(bus, LoadLimits(), clock)
    pressure = Pressure(bus, recordings.is_full, lambda: bool(load.refused))
    tape = tape_of(plant, origin, clock, pressure.look)
    space = space_watch(plant, clock)
    look = health_of(
        monitors, live, recorder, captures, bus, space, load, tape, recordings, soundness, stream
    )
    alarms = await alarm_engine(
        plant,
        origin,
        store,
        recorder.put,
        clock,
        _listener(captures, tape),
        vector_rows(plant),
        look,
        part,
        {unit: memory.alarms for unit, memory in memories.items()},
    )
    machines = {unit: monitor.unit for unit, monitor in monitors.items()}
    films = await film_keeper(plant, machines, store.films, clock)
    for unit, memory in memories.items():
        films.resume(unit, memory.films)
    around.watch_films(films.newest)
    evidence = evidence_of(plant, origin, live, films, store, captures, clock)
    watch(evidence, alarms, captures, origin)
    references = ReferencesInForce(monitors, store, clock)
    await references.look()  # before the first result
    return Analysis(
        ground=ground,
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
        rolling=Rolling(store.rollups, clock),
        retaining=Retaining(store.retention, retention_limits(plant.retention), clock),
        space=space,
        load=load,
        soundness=soundness,
    )


def _listener(captures: Captures, tape: Tape) -> Listener:
    """Both recorders of samples see every block, once the alarms have judged it."""

    def listen(block: SampleBlock, news: Sequence[AlarmNews]) -> None:
        captures.take(block, news)
        tape.take(block)

    return listen
