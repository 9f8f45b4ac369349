"""`padwatch serve` from start to end: a database in, API and dashboard out."""

import asyncio
import socket
from collections.abc import Callable
from contextlib import closing

from acquisition.clock import Clock
from service.app.access import access_desk
from service.app.audit_trail import ServiceTrail
from service.app.ground import Ground, live_view
from service.app.replica import Replica, replica_context, replica_on
from service.app.serving import Serving, serving_of
from service.app.stores import open_store
from service.app.supervision import Supervision
from service.measuring.metrics.timings import Timings
from service.runtime.heartbeats import Heartbeats
from service.runtime.process import stop_on_signals
from service.runtime.service_manager import NOBODY, ServiceManager
from service.settings.origin import Origin
from service.settings.plant import PlantFile
from service.store.port import Store


async def run_serve(
    plant: PlantFile,
    listener: socket.socket,
    clock: Clock,
    announce: Callable[[str], None],
    manager: ServiceManager = NOBODY,
) -> None:
    """Serve until SIGINT or SIGTERM.

    Parameters
    ----------
    listener
        Where the HTTP server listens.
    announce
        Called with the URL once the server answers.

    Raises
    ------
    StoreError
        If the database cannot be used.
    ClosedError
        If others could reach the service, and it is not fit for that.
    """
    with closing(open_store(plant)) as store:
        await _run(plant, store, listener, clock, announce, manager)


async def _run(
    plant: PlantFile,
    store: Store,
    listener: socket.socket,
    clock: Clock,
    announce: Callable[[str], None],
    manager: ServiceManager,
) -> None:
    desk = access_desk(plant, store.access, clock)
    replica = await replica_on(plant, store, clock)
    beats = Heartbeats(clock)
    ground = Ground(
        plant, Origin.LIVE, clock, store, live_view(plant, clock), beats, Timings([], clock)
    )
    audit = ServiceTrail(plant, Origin.LIVE, store.audit, clock)
    await audit.begin()
    context = replica_context(replica, desk, audit.refusals, beats)
    serving = serving_of(context, ground, listener, desk, announce)
    supervision = Supervision(manager, beats, replica.live, [u.id for u in plant.unit], clock)
    try:
        await _perform(replica, serving, supervision, beats)
    finally:
        desk.close()
        await audit.end()


async def _perform(
    replica: Replica, serving: Serving, supervision: Supervision, beats: Heartbeats
) -> None:
    stopped = stop_on_signals()
    async with asyncio.TaskGroup() as tasks:
        loops = {"feed": replica.feed.run, "references": replica.references.run}
        beside = [tasks.create_task(beats.tend(name, loops[name]), name=name) for name in loops]
        server = serving.start(tasks)
        announcing = tasks.create_task(serving.tell(supervision), name="announce")
        supervising = tasks.create_task(supervision.run(), name="supervise")
        await stopped.wait()
        supervision.stopping()
        serving.stop()
        for task in (*beside, announcing, supervising):
            task.cancel()
        await asyncio.wait([server])
