"""Start, supervision and restart of the serving process, a child of the measuring process."""

import asyncio
import pickle
import socket
import subprocess
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version

import structlog

from acquisition.clock import Clock
from service.live.exchange import MeasuringEnd, Question, VersionError
from service.runtime.child import Child, start_child
from service.runtime.heartbeats import Pulse
from service.settings.plant import PlantFile
from service.settings.storage import Origin

log = structlog.get_logger()

REPORT_EVERY_S = 0.5
"""Period of reports to the serving process, s."""

STEADY_S = 10.0
"""Run time, s, after which a serving process that ended is started again without a pause."""

PAUSE_S = 1.0
"""Pause before a serving process that ended sooner is started again, s."""

STOPS_WITHIN_S = 5.0


@dataclass(frozen=True)
class Start:
    """Plant and options with which the serving process starts.

    With `is_demo`, local clients have the admin role without a login.
    """

    plant: PlantFile
    origin: Origin
    is_demo: bool


class ServingChild:
    """Supervisor of the serving process, which it starts again after an unexpected end.

    Parameters
    ----------
    listener
        Listening socket of the HTTP server. It stays open while the child is started again, so
        that requests wait instead of being refused.
    report, answer
        Functions that make the reports to the serving process and answer its questions.
    child
        Serving process that was started before; with None one is started.
    """

    def __init__(
        self,
        start: Start,
        listener: socket.socket,
        report: Callable[[bool], object | None],
        answer: Callable[[Question], Awaitable[object]],
        clock: Clock,
        child: Child | None = None,
    ) -> None:
        self._start, self._listener, self._clock, self._next = start, listener, clock, child
        self._end = MeasuringEnd(report, answer, REPORT_EVERY_S)
        self._is_stopping = False
        self.process: subprocess.Popen[bytes] | None = None
        self.n_restarts = 0

    async def run(self, pulse: Pulse) -> None:
        """Keep the serving process running until cancelled; `pulse` gets heartbeats."""
        while True:
            pulse.rest()
            since_s = self._clock.monotonic_s()
            code = await self._run_once()
            if self._is_stopping:
                return
            self.n_restarts += 1
            log.error("the serving process has ended and is started again", code=code)
            if self._clock.monotonic_s() - since_s < STEADY_S:
                await self._clock.sleep(PAUSE_S)

    async def stop(self) -> None:
        """Let the serving process finish its requests; kill it after `STOPS_WITHIN_S` seconds."""
        self._is_stopping = True
        if self.process is None:
            return
        self.process.terminate()
        await asyncio.to_thread(_end_of, self.process)

    async def _run_once(self) -> int:
        child, self._next = self._next or start_child(), None
        self.process = child.process
        with suppress(ConnectionError):  # it has ended
            socket.send_fds(child.connection, [b"."], [self._listener.fileno()])
        reader, writer = await asyncio.open_connection(sock=child.connection)
        try:
            write_start(writer, self._start)
            await self._end.serve(reader, writer)
        except ConnectionError:
            pass  # it has ended
        finally:
            writer.close()
        return await asyncio.to_thread(_end_of, child.process)


def _end_of(process: subprocess.Popen[bytes]) -> int:
    """Return the exit code of an ending process; kill it after `STOPS_WITHIN_S`."""
    try:
        return process.wait(STOPS_WITHIN_S)
    except subprocess.TimeoutExpired:
        log.warning("the serving process did not stop in time and is killed")
        process.kill()
        return process.wait()


def write_start(writer: asyncio.StreamWriter, start: Start) -> None:
    """Write the version of padwatch and the start options of the serving process."""
    content = pickle.dumps(start, pickle.HIGHEST_PROTOCOL)
    writer.write(b"%s %d\n" % (version("padwatch").encode(), len(content)) + content)


async def read_start(reader: asyncio.StreamReader) -> Start:
    """Read and return the start options that `write_start` wrote.

    Raises `VersionError` if the measuring process is of another version.
    """
    theirs, n_bytes = (await reader.readline()).decode().split()
    own = version("padwatch")
    if theirs != own:
        raise VersionError(
            f"the serving process is padwatch {own}, the measuring process padwatch {theirs}:"
            " restart padwatch"
        )
    start: Start = pickle.loads(await reader.readexactly(int(n_bytes)))  # noqa: S301  own parent
    return start
