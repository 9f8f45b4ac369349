"""`padwatch run` and `replay`: the measuring process, with the serving process as its child."""

import asyncio
import socket
import subprocess
from collections.abc import Callable, Mapping
from contextlib import closing, suppress
from dataclasses import dataclass, field

import structlog

from acquisition.clock import Clock
from core.alarms.alarm import PLANT
from service.app.analysis import opened_analysis
from service.app.listener import require_protected
from service.app.process import Host, Supervision
from service.app.service_audit import ServiceTrail
from service.app.storage import database_path, open_access
from service.live.alarm_list import SHARED
from service.live.exchange import MeasuringEnd, Start, write_start
from service.measuring.analyser import Runner
from service.measuring.commands import Questions
from service.measuring.live_view import LiveView
from service.measuring.snapshots import Reports
from service.measuring.sources import WatchedUnit
from service.runtime.child import Child, start_child
from service.runtime.heartbeats import Loop, Pulse
from service.runtime.polls import TimedSource
from service.runtime.process import exempt_start
from service.settings.plant import PlantFile
from service.settings.storage import Origin
from service.store.holds import exclusive_use

log = structlog.get_logger()

REPORT_EVERY_S = 0.5
"""Period of reports to the serving process, s."""

STEADY_S = 10.0
"""Run time, s, after which a serving process that ended is started again without a pause."""

PAUSE_S = 1.0
"""Pause before a serving process that ended sooner is started again, s."""

STOPS_WITHIN_S = 5.0


@dataclass
class ServingChild:
    """Supervisor of the serving process, which it starts again after an unexpected end.

    Parameters
    ----------
    listener
        Listening socket of the HTTP server. It stays open while the child is started again, so
        that requests wait instead of being refused.
    end
        This process's end of the connection, which makes reports and answers questions.
    child
        Serving process that was started before; with None one is started.
    """

    start: Start
    listener: socket.socket
    end: MeasuringEnd
    clock: Clock
    child: Child | None = None
    _is_stopping: bool = field(default=False, init=False)

    async def run(self, pulse: Pulse) -> None:
        """Keep the serving process running until cancelled; `pulse` gets heartbeats."""
        while True:
            pulse.rest()
            since_s = self.clock.monotonic_s()
            code = await self._run_once()
            if self._is_stopping:
                return
            log.error("the serving process has ended and is started again", code=code)
            if self.clock.monotonic_s() - since_s < STEADY_S:
                await self.clock.sleep(PAUSE_S)

    async def stop(self) -> None:
        """Let the serving process finish its requests; kill it after `STOPS_WITHIN_S` seconds."""
        self._is_stopping = True
        if self.child is not None:
            self.child.process.terminate()
            await asyncio.to_thread(_end_of, self.child.process)

    async def _run_once(self) -> int:
        child = self.child = self.child or start_child()
        with suppress(ConnectionError):  # it has ended
            socket.send_fds(child.connection, [b"."], [self.listener.fileno()])
        reader, writer = await asyncio.open_connection(sock=child.connection)
        try:
            write_start(writer, self.start)
            await self.end.serve(reader, writer)
        except ConnectionError:
            pass  # it has ended
        finally:
            writer.close()
        code = await asyncio.to_thread(_end_of, child.process)
        self.child = None
        return code


def _end_of(process: subprocess.Popen[bytes]) -> int:
    """Return the exit code of an ending process; kill it after `STOPS_WITHIN_S`."""
    try:
        return process.wait(STOPS_WITHIN_S)
    except subprocess.TimeoutExpired:
        log.warning("the serving process did not stop in time and is killed")
        process.kill()
        return process.wait()


async def run_service(
    plant: PlantFile,
    units: Mapping[str, WatchedUnit],
    host: Host,
    *,
    origin: Origin = Origin.LIVE,
    ends: bool = False,
    is_demo: bool = False,
    child: Child | None = None,
    at_end: Callable[[LiveView], None] | None = None,
) -> None:
    """Run the service until SIGINT or SIGTERM, or as configured until all sources have ended.

    Parameters
    ----------
    units
        Source of every unit of the plant.
    host
        Surroundings of the process; the serving process inherits the listening socket.
    origin
        Origin, live or replay, of the data in the database and in the API responses.
    ends
        Whether the service stops when all sources have ended.
    is_demo
        Whether local clients have the admin role without a login.
    child
        Serving process that was started before; with None one is started.
    at_end
        Function called with the newest results when all sources have ended; None for no call.

    Raises
    ------
    StoreError
        If the database cannot be used.
    ClosedError
        If the service would be reachable from other hosts without TLS or accounts.
    """
    clock = host.clock
    timed = {u: its.source for u, its in units.items() if isinstance(its.source, TimedSource)}
    opened = opened_analysis(plant, origin, clock, sources=timed)
    with exclusive_use(database_path(plant)), opened as analysis:
        with closing(open_access(plant, origin)) as access:
            require_protected(plant, access)
        live, beats = analysis.live, analysis.beats
        await analysis.start()
        runner = Runner(
            units, live, analysis.analyser, analysis.recorder, analysis.bus, beats, clock
        )
        audit = ServiceTrail(plant, origin, analysis.store.audit, clock)
        await audit.begin()
        held = [*(unit.id for unit in plant.unit), PLANT]
        supervision = Supervision(host, beats, live.status, units)
        found = (plant.unit, live, analysis.alarms, analysis.films, analysis.snapshot)
        reports = Reports("measuring", lambda: [*held, SHARED], *found)
        parts = (analysis.executor, analysis.soundness, analysis.metrics)
        questions = Questions(*parts, supervision.announce)
        end = MeasuringEnd(reports.report, questions.answer, REPORT_EVERY_S)
        serving = ServingChild(Start(plant, origin, is_demo), host.listener, end, clock, child)

        async def run() -> None:
            await runner.run()
            if at_end is not None:
                at_end(live)

        loops: dict[str, Loop] = {"clock": audit.watch_clock, "serve": serving.run}
        loops |= analysis.own_loops | analysis.shared_loops
        if plant.store.postgresql is not None and origin is Origin.LIVE:  # may have replicas
            loops |= analysis.reporting_loops(lambda: held)
        exempt_start()
        try:
            await supervision.run_until_stopped(loops, run, lambda _: serving.stop(), ends=ends)
        finally:
            await analysis.close()
            await audit.end()
