"""`padwatch acquire` from start to end: devices in, blocks on the stream out."""

import asyncio
import socket
from collections.abc import Callable, Iterator, Mapping

from prometheus_client.metrics_core import Metric
from prometheus_client.process_collector import ProcessCollector

from acquisition.clock import Clock
from service.api.http.listening import url_of
from service.app.ground import live_view
from service.app.health.page import Health
from service.app.health.serving import HealthServer
from service.app.supervision import Supervision
from service.cluster.stream.names import identity_of
from service.cluster.stream.publisher import Publisher
from service.cluster.stream.publisher_metrics import publisher_metrics
from service.live.live_view import LiveView
from service.measuring.acquiring import Acquirer
from service.measuring.watched_unit import WatchedUnit
from service.runtime.heartbeats import Heartbeats
from service.runtime.process import stop_on_signals
from service.runtime.service_manager import NOBODY, ServiceManager
from service.settings.plant import PlantFile
from service.settings.stream import StreamSettings

DRAIN_S = 3.0
"""What the servers get, when the process stops, to take what still waits for them."""


async def run_acquire(
    plant: PlantFile,
    settings: StreamSettings,
    units: Mapping[str, WatchedUnit],
    listener: socket.socket,
    clock: Clock,
    announce: Callable[[str], None],
    manager: ServiceManager = NOBODY,
) -> None:
    """Acquire and publish until SIGINT or SIGTERM.

    Parameters
    ----------
    units
        Those whose devices are read; their monitors are not used.
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
        return  # the devices' rings may have it yet; if not, its index tells what is missing


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
