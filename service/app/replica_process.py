"""`padwatch serve`: a serving process of a cluster, which reads reports from the database."""

import asyncio
from collections.abc import Sequence
from contextlib import closing
from functools import partial

from prometheus_client.process_collector import ProcessCollector

from acquisition.clock import Clock
from service.api.auth.authenticator import Authenticator
from service.api.context import Context
from service.app.listener import require_protected
from service.app.notifications import receivers_of
from service.app.process import Host, Supervision
from service.app.service_audit import ServiceTrail
from service.app.serving_process import access_desk, context_of, serve_requests
from service.app.storage import open_access, open_store
from service.cluster.serving_side import DatabaseSender, Feed, replica_receivers
from service.live.client import LiveClient
from service.live.commands import Operators
from service.live.metrics import add_plant
from service.live.receivers import ReceiverView
from service.notifications.metrics import add_deliveries
from service.runtime.heartbeats import Heartbeats
from service.runtime.metrics import Families
from service.settings.plant import PlantFile
from service.settings.storage import Origin
from service.store.port import StoreError
from service.store.store import Store

REPORTS = {
    "reports_readable": "This is 1 if the reports in the database could be read.",
    "unit_analysed": "This is 1 while a process reports on the unit.",
    "unit_silence_seconds": "This is the time since the last report of the process that analyses"
    " the unit.",
}


class Replica:
    """State of a plant, read from the reports of other processes in the database."""

    def __init__(self, plant: PlantFile, store: Store, clock: Clock) -> None:
        self._plant, self._store, self._clock = plant, store, clock
        self.live = LiveClient(plant, store.films, clock)
        self.feed = Feed(store, self.live, clock)
        its = receivers_of(plant, Origin.LIVE, clock)
        self.receivers = partial(asyncio.to_thread, replica_receivers, its, store.outbox)

    def checks(self) -> dict[str, str]:
        """Return the status of the analysis of each unit as text, by name of the check."""
        checks, units = {}, self.live.units
        for unit in self._plant.unit:
            words = "no heartbeat yet"
            if (silence_s := units.silence_s(unit.id)) is not None:
                words = "" if units.is_alive(unit.id) else "silent: "
                words += f"last heartbeat {silence_s:.1f} s ago"
            checks[f"analysis of {unit.id}"] = words
        return checks

    async def metrics(self) -> bytes:
        """Return the metrics of this process and of the units reported to it."""
        views: Sequence[ReceiverView] | None
        try:
            views = await self.receivers()
        except StoreError:
            views = None
        families, units = Families(), self.live.units
        families.add_program(self._store.kind)
        families.declare(REPORTS)
        families.add("reports_readable", units.read_error is None)
        for unit in self._plant.unit:
            families.add("unit_analysed", units.is_alive(unit.id), unit=unit.id)
            families.add("unit_silence_seconds", units.silence_s(unit.id), unit=unit.id)
        add_plant(families, self.live, self._plant)
        add_deliveries(families, views, self._clock.now_ns())
        families.include(ProcessCollector(registry=None))
        return families.text

    def context(self, desk: Authenticator, beats: Heartbeats) -> Context:
        """Return the API context of this process."""
        sender = DatabaseSender(self._store, self._clock)
        operators = Operators(sender.send, self._store, self.live.alarms)
        return context_of(
            *(self._plant, self._store, self.live, operators, self._clock),
            access=desk,
            receivers=self.receivers,
            metrics=self.metrics,
            loops=beats.look,
            checks=self.checks,
        )


async def run_serve(plant: PlantFile, host: Host) -> None:
    """Serve the API from the database until SIGINT or SIGTERM.

    Raises
    ------
    StoreError
        If the database cannot be used.
    ClosedError
        If the service would be reachable from other hosts without TLS or accounts.
    """
    with closing(open_store(plant)) as store, closing(open_access(plant)) as access:
        require_protected(plant, access)
        clock = host.clock
        replica, beats = Replica(plant, store, clock), Heartbeats(clock)
        context = replica.context(access_desk(plant, access, clock), beats)
        await replica.feed.start()
        audit = ServiceTrail(plant, Origin.LIVE, store.audit, clock)
        await audit.begin()
        supervision = Supervision(host, beats, replica.live.units.status, context.units)
        ended = asyncio.Event()

        async def ready(url: str, token: str | None) -> None:
            supervision.announce(url, token)

        async def serve() -> None:
            await serve_requests(context, plant, host.listener, {}, ended, ready)

        async def drain(serving: asyncio.Task[None]) -> None:
            ended.set()
            await asyncio.wait([serving])

        try:
            await supervision.run_until_stopped({"feed": replica.feed.run}, serve, drain)
        finally:
            await audit.end()
