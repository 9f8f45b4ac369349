"""`padwatch acquire` and `padwatch analyse`: measuring shared between processes."""

import asyncio
import socket
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack

from prometheus_client.metrics_core import Metric
from prometheus_client.process_collector import ProcessCollector

from acquisition.clock import Clock
from core.alarms.alarm import PLANT
from core.monitor.monitor import UnitMonitor
from core.samples.gaps import Reach
from service.api.http.listening import url_of
from service.app.health_page import Health, HealthServer
from service.app.measuring_process import Analysis, analysis_on, reporting_loops
from service.app.notifications import router_of
from service.app.process import Ground, Supervision, live_view
from service.app.service_health import recording_error
from service.app.storage import database_path, open_store
from service.cluster.consumer import Consumer, consumer_metrics
from service.cluster.ownership import Holds, Leadership, Partition
from service.cluster.progress import UnitProgress, memories_of, usable
from service.cluster.publisher import Publisher, publisher_metrics
from service.cluster.session import identity_of
from service.cluster.silent_units import Silence, SilentUnits, silences_s
from service.live.live_view import LiveView
from service.measuring.acquirer import Acquirer, Bus
from service.measuring.analyser import BUS_CAPACITY, UnitMemory
from service.measuring.counters import store_info
from service.measuring.service_alarms import SHARED, StreamLook
from service.measuring.sources import WatchedUnit
from service.measuring.timings import Timings, timed_monitors
from service.notifications.message import Around
from service.runtime.heartbeats import Heartbeats, Loop, Pulse
from service.runtime.process import stop_on_signals
from service.runtime.service_manager import NO_MANAGER, ServiceManager
from service.settings.plant import PlantFile
from service.settings.processes import StreamSettings
from service.settings.storage import Origin
from service.store.holds import exclusive_use
from service.store.sharing import StreamPosition

DRAIN_S = 3.0
"""Time for the servers to accept waiting blocks when the process stops."""


async def run_acquire(
    plant: PlantFile,
    settings: StreamSettings,
    units: Mapping[str, WatchedUnit],
    listener: socket.socket,
    clock: Clock,
    announce: Callable[[str], None],
    manager: ServiceManager = NO_MANAGER,
) -> None:
    """Acquire and publish until SIGINT or SIGTERM.

    Parameters
    ----------
    units
        Units whose devices are read; their monitors are not used.
    listener
        Where the health page is served.
    announce
        Called with its URL once it answers.
    """
    beats, live = Heartbeats(clock), live_view(plant, clock)
    identities = {unit.id: identity_of(plant, unit) for unit in plant.unit if unit.id in units}
    publisher = Publisher(plant, settings, identities, clock)
    acquirer = Acquirer(units, live, clock, publisher.publish, publisher.tell, beats)
    health = HealthServer(_health(publisher, live, beats, list(units)), listener, clock)
    supervision = Supervision(manager, beats, live, units, clock)
    stopped = stop_on_signals()
    async with asyncio.TaskGroup() as tasks:
        acquiring = tasks.create_task(acquirer.run(), name="acquire")
        publishing = tasks.create_task(beats.tend("publish", publisher.run), name="publish")
        server = health.start(tasks, beats)
        await health.started()
        supervision.ready()
        announce(url_of(listener))
        supervising = tasks.create_task(supervision.run(), name="supervise")
        await stopped.wait()
        supervision.stopping()
        health.stop()
        supervising.cancel()
        acquiring.cancel()
        await _drain(publisher)
        publishing.cancel()
        await asyncio.wait([server])


async def _drain(publisher: Publisher) -> None:
    try:
        await asyncio.wait_for(publisher.waiting.drained(), DRAIN_S)
    except TimeoutError:
        return  # the devices' rings may still hold the samples; otherwise the index shows the gap


def _health(publisher: Publisher, live: LiveView, beats: Heartbeats, units: list[str]) -> Health:
    def checks() -> dict[str, str | None]:
        loops = {f"loop {name}": trouble for name, trouble in beats.look().items()}
        return {"stream": publisher.trouble, **loops}

    def shown() -> dict[str, str]:
        return {f"unit {unit}": live.status(unit).state.value for unit in units}

    def metrics() -> Iterator[Metric]:
        yield from publisher_metrics(publisher)
        yield from ProcessCollector(registry=None).collect()

    return Health(checks, shown, metrics)


WATCH_EVERY_S = 1.0


async def run_analyse(
    plant: PlantFile,
    partition: Partition,
    settings: StreamSettings,
    monitors: Mapping[str, UnitMonitor],
    listener: socket.socket,
    clock: Clock,
    announce: Callable[[str], None],
    manager: ServiceManager = NO_MANAGER,
) -> None:
    """Analyse the units of a partition until SIGINT or SIGTERM.

    Parameters
    ----------
    plant
        The whole plant.
    monitors
        Monitors of the units of the partition.
    listener
        Where the health page is served.
    announce
        Called with its URL once it answers.

    Raises
    ------
    StoreError
        If the database cannot be used, or another process may have taken the units over.
    StreamAnewError
        If the stream has been replaced since the start.
    """
    part = partition.part_of(plant)
    live = live_view(part, clock)
    around = Around(live)
    with ExitStack() as stack:
        if plant.store.postgresql is None:
            stack.enter_context(exclusive_use(database_path(plant)))
        store = open_store(part, Origin.LIVE, router_of(part, Origin.LIVE, around, clock))
        stack.callback(store.close)
        ground = Ground(
            part, Origin.LIVE, clock, store, live, Heartbeats(clock), Timings(monitors, clock)
        )
        analysing = Analysing(plant, partition, settings, monitors, ground, around)
        try:
            await analysing.run(listener, announce, manager)
        finally:
            await analysing.close()


class Analysing:
    """The process while it stands by, analyses and stops."""

    def __init__(
        self,
        plant: PlantFile,
        partition: Partition,
        settings: StreamSettings,
        monitors: Mapping[str, UnitMonitor],
        ground: Ground,
        around: Around,
    ) -> None:
        self._share, self._settings = partition.share_of(plant), settings
        self._monitors, self._ground, self._around = monitors, ground, around
        self._plant = plant
        self._holds = Holds(ground.store, monitors, ground.clock)
        self._stored: dict[str, StreamPosition] = {}
        self._memories: dict[str, UnitMemory] = {}
        self._analysis: Analysis | None = None
        self._consumer: Consumer | None = None
        self._silence: Silence | None = None
        self._silent_units: SilentUnits | None = None

    async def run(
        self, listener: socket.socket, announce: Callable[[str], None], manager: ServiceManager
    ) -> None:
        """Stand by, analyse, stop."""
        ground = self._ground
        health = HealthServer(self._health(), listener, ground.clock)
        supervision = Supervision(manager, ground.beats, ground.live, self._monitors, ground.clock)
        stopped = stop_on_signals()
        async with asyncio.TaskGroup() as tasks:
            server = health.start(tasks, ground.beats)
            await health.started()
            supervision.ready()
            announce(url_of(listener))
            supervising = tasks.create_task(supervision.run(), name="supervise")
            analysing = tasks.create_task(self._analyse(), name="analyse")
            await stopped.wait()
            supervision.stopping()
            health.stop()
            supervising.cancel()
            analysing.cancel()
            await asyncio.wait([server])

    async def close(self) -> None:
        """Write all pending data, then release the units to other processes."""
        if self._analysis is not None:
            await self._analysis.close()
        self._holds.release()

    async def _analyse(self) -> None:
        ground = self._ground
        await self._holds.take()
        bus = Bus(BUS_CAPACITY, ground.clock)  # always empty: blocks wait in the stream
        monitors = timed_monitors(self._monitors, ground.timings)
        self._stored = {
            unit: found
            for unit in monitors
            if (found := await asyncio.to_thread(ground.store.position, unit)) is not None
        }
        self._memories = memories_of(self._stored.values())
        stream = StreamLook(self._trouble, self._behind_s)
        analysis = await analysis_on(
            ground, monitors, bus, self._around, self._share, self._memories, stream
        )
        self._analysis = analysis
        consumer = Consumer(
            self._plant, self._settings, self._begin, analysis.recorder, ground.clock
        )
        self._consumer = consumer
        everywhere = [unit.id for unit in self._plant.unit]
        silent = SilentUnits(everywhere, analysis.alarms, ground.store, ground.clock)
        self._silent_units = silent
        after_s = silences_s(ground.plant.unit, self._settings.silent_after_s)
        self._silence = Silence(after_s, analysis.analyser, ground.live, ground.clock)
        tend = ground.beats.tend
        async with asyncio.TaskGroup() as tasks:
            analysis.start(tasks)
            shared = {**shared_work(analysis), "silent units": silent.run}
            leading = Leadership(ground.store.hold, shared, ground.beats, ground.clock)
            tasks.create_task(tend("lead", leading.run), name="lead")
            tasks.create_task(tend("record", analysis.recorder.run), name="record")
            tasks.create_task(tend("stream", consumer.run), name="stream")
            tasks.create_task(tend("watch", self._watch), name="watch")
            for name, loop in reporting_loops(analysis, self._held).items():
                tasks.create_task(tend(name, loop), name=name)

    def _held(self) -> list[str]:
        """Return the units and shared parts that this process publishes now."""
        is_watching = self._silent_units is not None and self._silent_units.is_watching
        service = [PLANT] if self._share.leads else []
        return [*self._monitors, *service, *([SHARED] if is_watching else [])]

    def _trouble(self) -> str | None:
        """Why no blocks come over the stream."""
        return None if self._consumer is None else self._consumer.trouble

    def _behind_s(self) -> float:
        """Return how far the analysed blocks lag behind their devices."""
        units = self._consumer.units if self._consumer else {}
        return max((progress.behind_s for progress in units.values()), default=0.0)

    async def _begin(self, stream: str, newest: int) -> dict[str, UnitProgress]:
        """Return where each unit resumes."""
        reaches = {
            unit: await asyncio.to_thread(self._ground.store.reach, unit) for unit in self._monitors
        }
        return {
            unit: self._progress(unit, stream, newest, reach) for unit, reach in reaches.items()
        }

    def _progress(self, unit: str, stream: str, newest: int, reach: Reach | None) -> UnitProgress:
        ground, analysis = self._ground, self._analysis
        if analysis is None:
            raise RuntimeError("there is no analysis yet")
        stored = usable(self._stored.get(unit), stream, newest)
        settings = next(its for its in ground.plant.unit if its.id == unit)
        identity = identity_of(self._plant, settings)
        parts = (analysis.analyser, ground.live, analysis.recorder, ground.clock)
        done = reach if stored is None else None
        return UnitProgress(identity, stream, stored, self._memories.get(unit), *parts, done)

    async def _watch(self, pulse: Pulse) -> None:
        """Check that this process still holds its units, and which units are silent."""
        while True:
            pulse.beat(WATCH_EVERY_S)
            await asyncio.to_thread(self._holds.require)
            consumer, silence = self._consumer, self._silence
            if consumer is not None and silence is not None:
                silence.look(consumer.units, consumer.trouble, consumer.waiting)
            await self._ground.clock.sleep(WATCH_EVERY_S)

    def _health(self) -> Health:
        def checks() -> dict[str, str | None]:
            consumer = self._consumer
            waits_for = self._holds.waits_for
            loops = {f"loop {name}": t for name, t in self._ground.beats.look().items()}
            return {
                "units": None if waits_for is None else f"standing by: {waits_for}",
                "store": self._ground.live.store_error,
                "stream": "not begun" if consumer is None else self._trouble(),
                **loops,
            }

        def shown() -> dict[str, str]:
            units = {u: self._ground.live.status(u).state.value for u in self._monitors}
            shown = {f"unit {unit}": state for unit, state in units.items()}
            shown["database"] = self._ground.store.kind
            if self._analysis is not None:  # the plant has one alarm of each kind
                shown |= _of_this_host(self._analysis)
            return shown

        def metrics() -> Iterator[Metric]:
            if self._consumer is not None:
                yield from consumer_metrics(self._consumer)
            yield store_info(self._ground.store.kind)
            yield from ProcessCollector(registry=None).collect()

        return Health(checks, shown, metrics)


def _of_this_host(analysis: Analysis) -> dict[str, str]:
    """Return conditions of this host; only the leading process raises alarms about them."""
    troubles = {
        "stored data": analysis.soundness.trouble,
        "captures": analysis.captures.trouble,
        "recordings": recording_error(analysis.tape, analysis.recordings),
    }
    return {"disk": str(analysis.space), **{name: why or "ok" for name, why in troubles.items()}}


def shared_work(analysis: Analysis) -> dict[str, Loop]:
    """Return the loops that one process runs for the whole plant."""

    async def deliver(pulse: Pulse) -> None:
        pulse.rest()  # each sender has its own heartbeat
        await analysis.deliveries.run(analysis.ground.beats)
        await asyncio.Event().wait()  # without receivers there is nothing to do

    return {**analysis.shared_loops, "deliver": deliver}
