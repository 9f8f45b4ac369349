"""`Serving`: the HTTP server with API and dashboard, and how it says that it is there."""

import asyncio
import gc
import socket
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

from service.api.auth.authenticator import AccessDesk
from service.api.auth.refusals import Refusals
from service.api.context import Context
from service.api.http.listening import url_of
from service.api.http.server import GuardedServer
from service.api.load import Shedding
from service.app.analysis import Analysis
from service.app.application import application
from service.app.evidence import evidence_folders
from service.app.ground import Ground
from service.app.scrape import scrape
from service.app.supervision import Supervision
from service.app.tapes import recordings_folder
from service.app.watched import Watched
from service.app.web import server_of
from service.measuring.bus import Bus
from service.measuring.in_process import InProcess
from service.reports.desk import EvidenceDesk
from service.runtime.polls import TimedSource

GC_THRESHOLDS = (20_000, 20, 20)
"""Seldom enough to cost nothing; what a request or a block leaves is mostly no cycle."""


@dataclass(frozen=True)
class Serving:
    """A server on a socket.

    Parameters
    ----------
    announce
        Called with the URL once the server answers, and then with the token for setting up where
        there is no account.
    afterwards
        What need not be there before the server answers; called once, in a thread.
    """

    ground: Ground
    server: GuardedServer
    listener: socket.socket
    desk: AccessDesk
    announce: Callable[[str], None]
    afterwards: Callable[[], object]

    def start(self, tasks: asyncio.TaskGroup) -> asyncio.Task[None]:
        """Begin to serve; ends after `stop`."""
        serve = partial(self.server.run_on, self.listener)
        return tasks.create_task(self.ground.beats.tend("serve", serve), name="serve")

    def stop(self) -> None:
        """Take no more requests."""
        self.server.should_exit = True

    async def tell(self, supervision: Supervision) -> None:
        """Announce the server as soon as it answers."""
        while not self.server.started:
            await asyncio.sleep(0.01)
        supervision.ready()
        self.announce(url_of(self.listener, has_tls=self.server.config.is_ssl))
        if token := await self.desk.offer_set_up():
            self.announce(f"to make the first account, within one hour and once: {token}")
        await asyncio.to_thread(self.afterwards)
        gc.collect()
        gc.freeze()  # what is there from the start stays: to look through it again takes 0.1 s
        gc.set_threshold(*GC_THRESHOLDS)


def serving_of(
    context: Context,
    ground: Ground,
    listener: socket.socket,
    desk: AccessDesk,
    announce: Callable[[str], None],
    evidence: EvidenceDesk | None = None,
) -> Serving:
    """What serves a context. Its description is made once, before a client asks for it."""
    app = application(context, evidence)
    asked = app if context.load is None else Shedding(app, context.load)
    server = server_of(asked, ground.plant, ground.clock)
    return Serving(ground, server, listener, desk, announce, afterwards=app.rendered)


def context_of(
    analysis: Analysis,
    desk: AccessDesk,
    refusals: Refusals,
    bus: Bus,
    sources: Mapping[str, TimedSource],
) -> Context:
    """What the API works with in a process that analyses, too."""
    ground = analysis.ground
    plant = ground.plant
    return Context(
        plant_name=plant.plant.name,
        units={unit.id: unit for unit in plant.unit},
        live=ground.live,
        store=ground.store,
        clock=ground.clock,
        refresh_s=ground.refresh_s,
        references=analysis.references,
        alarms=analysis.alarms,
        films=analysis.films,
        operators=InProcess(analysis.alarms, analysis.films, analysis.recorder),
        captures=analysis.captures,
        deliveries=analysis.deliveries,
        evidence=lambda: analysis.evidence.status,
        configuration=analysis.evidence.configuration,
        metrics=partial(scrape, metrics_of(analysis, bus, sources)),
        origin=ground.origin,
        max_shelf_s=3600.0 * plant.alarms.max_shelf_h,
        sources=sources,
        loops=ground.beats.look,
        refusals=refusals,
        access=desk,
        space=analysis.space,
        load=analysis.load,
        tape=analysis.tape,
        recordings=(evidence_folders(plant).captures, recordings_folder(plant)),
        faults=lambda: analysis.recordings.faults,
        stored_trouble=lambda: analysis.soundness.trouble,
    )


def metrics_of(analysis: Analysis, bus: Bus, sources: Mapping[str, TimedSource]) -> Watched:
    """What metrics are read from in a process that analyses."""
    ground = analysis.ground
    return Watched(
        bearings={unit.id: [bearing.id for bearing in unit.bearing] for unit in ground.plant.unit},
        live=ground.live,
        bus=bus,
        recorder=analysis.recorder,
        alarms=analysis.alarms,
        films=analysis.films,
        captures=analysis.captures,
        evidence=analysis.evidence,
        deliveries=analysis.deliveries,
        timings=ground.timings,
        clock=ground.clock,
        sources=sources,
        space=analysis.space,
        load=analysis.load,
        tape=analysis.tape,
        recordings=analysis.recordings,
        soundness=analysis.soundness,
        store_kind=ground.store.kind,
    )
