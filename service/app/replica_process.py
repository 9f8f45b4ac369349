"""`padwatch serve`: a serving process of a cluster, which reads reports from the database."""

import asyncio
import socket
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from functools import partial

from acquisition.clock import Clock
from service.api.auth.authenticator import Authenticator
from service.api.context import Context
from service.app.listener import require_protected
from service.app.notifications import receivers_of
from service.app.process import Supervision
from service.app.service_audit import ServiceTrail
from service.app.serving_process import context_of, references_of, serve_requests
from service.app.storage import open_access, open_store
from service.app.web import access_desk
from service.cluster.replica_metrics import replica_metrics
from service.cluster.serving_side import DatabaseOperators, Feed, replica_receivers
from service.live.client import LiveClient
from service.runtime.heartbeats import Heartbeats, Pulse
from service.runtime.service_manager import NO_MANAGER, ServiceManager
from service.settings.plant import PlantFile
from service.settings.storage import Origin
from service.store.store import Store


class Replica:
    """State of a plant, read from the reports of other processes in the database."""

    def __init__(self, plant: PlantFile, store: Store, clock: Clock) -> None:
        self._plant, self._store, self._clock = plant, store, clock
        self.live = LiveClient(plant, store.films, clock)
        self.feed = Feed(store, self.live, clock)
        self.references = references_of(plant, store, clock)
        its = receivers_of(plant, Origin.LIVE, clock)
        self.receivers = partial(asyncio.to_thread, replica_receivers, its, store.outbox)

    async def start(self) -> None:
        """Read the present state of the plant; call it before the first request.

        Raises `StoreError` if the state cannot be read.
        """
        await self.feed.start()
        await self.references.look()

    def checks(self) -> dict[str, str]:
        """Return the status of the analysis of each unit as text, by name of the check."""
        return {f"analysis of {unit.id}": self._words_of(unit.id) for unit in self._plant.unit}

    def _words_of(self, unit: str) -> str:
        silence_s = self.live.units.silence_s(unit)
        if silence_s is None:
            return "no heartbeat yet"
        said = f"last heartbeat {silence_s:.1f} s ago"
        return said if self.live.units.is_alive(unit) else f"silent: {said}"

    async def _metrics(self) -> bytes:
        kind = self._store.kind
        return await replica_metrics(self._plant, self.live, self.receivers, self._clock, kind)

    def context(self, desk: Authenticator, beats: Heartbeats) -> Context:
        """Return the API context of this process."""
        store, live = self._store, self.live
        context = context_of(
            *(self._plant, store, live, DatabaseOperators(store, live.alarms, self._clock)),
            *(self.references, desk, self._clock),
        )
        return replace(
            context,
            receivers=self.receivers,
            metrics=self._metrics,
            loops=beats.look,
            checks=self.checks,
        )


async def run_serve(
    plant: PlantFile,
    listener: socket.socket,
    clock: Clock,
    announce: Callable[[str], None],
    manager: ServiceManager = NO_MANAGER,
) -> None:
    """Serve the API from the database until SIGINT or SIGTERM.

    `listener` is the listening socket; `announce` is called with the URL when requests are served.

    Raises
    ------
    StoreError
        If the database cannot be used.
    ClosedError
        If the service would be reachable from other hosts without TLS or accounts.
    """
    with closing(open_store(plant)) as store, closing(open_access(plant)) as access:
        require_protected(plant, access)
        desk = access_desk(plant, access, clock)
        replica, beats = Replica(plant, store, clock), Heartbeats(clock)
        await replica.start()
        audit = ServiceTrail(plant, Origin.LIVE, store.audit, clock)
        await audit.begin()
        context = replica.context(desk, beats)
        units = [unit.id for unit in plant.unit]
        supervision = Supervision(manager, beats, replica.live.units, units, clock)
        ended, served = asyncio.Event(), asyncio.Event()

        async def ready(url: str, token: str | None) -> None:
            supervision.announce(announce, url, token)

        async def serve(pulse: Pulse) -> None:
            pulse.rest()
            loops = {"feed": replica.feed.run, "references": replica.references.run}
            await serve_requests(context, plant, listener, desk, loops, ended, ready)
            served.set()

        async def drain(_: asyncio.Task[None]) -> None:
            ended.set()
            await served.wait()

        try:
            await supervision.run_until_stopped({"serve": serve}, drain=drain)
        finally:
            await desk.close()
            await audit.end()
