"""Acquisition: reading of sample blocks and link states from sources, and the queue of blocks."""

import asyncio
import random
from collections import deque
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from functools import partial

import structlog
from pydantic import ConfigDict

from acquisition.clock import Clock
from acquisition.errors import AcquisitionError, ConfigError
from acquisition.source import SampleSource
from core.samples.blocks import SampleBlock
from service.live.status import LinkState
from service.measuring.live_view import LiveView
from service.measuring.sources import WatchedUnit
from service.runtime.heartbeats import Heartbeats, Pulse
from service.runtime.polls import TimedSource


@dataclass(frozen=True)
class LinkNews:
    """Link state of a unit, reported after a change and after a failed attempt to connect.

    `reason` is the reason why no samples arrive; None while connected.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")  # messages of the stream contain it

    unit: str
    state: LinkState
    reason: str | None = None

    @property
    def is_connected(self) -> bool:
        """Whether the link state is connected, so that samples arrive."""
        return self.state is LinkState.CONNECTED


class Bus(asyncio.Queue[SampleBlock]):
    """Queue of sample blocks between acquisition and analysis in one process.

    Publishers wait while the queue is full: the device buffers samples in its ring, and if the ring
    overruns, the sample index shows the exact gap. The queue drops nothing. `capacity` is the
    maximum number of blocks.
    """

    def __init__(self, capacity: int, clock: Clock) -> None:
        super().__init__(capacity)
        self._clock = clock
        self._published_s: deque[float] = deque()

    @property
    def oldest_wait_s(self) -> float:
        """Age of the oldest block whose analysis has not finished, s; 0 if there is none."""
        if not self._published_s:
            return 0.0
        return self._clock.monotonic_s() - self._published_s[0]

    async def put(self, item: SampleBlock) -> None:
        """Add a block; wait while the queue is full."""
        await super().put(item)
        self._published_s.append(self._clock.monotonic_s())

    def task_done(self) -> None:
        """Mark the oldest block that was taken from the queue as analysed."""
        super().task_done()
        self._published_s.popleft()


class ConnectGate:
    """Rate limiter of connection attempts to all devices, ``per_s`` attempts per second."""

    def __init__(self, per_s: float, clock: Clock) -> None:
        self._interval_s = 1.0 / per_s
        self._clock = clock
        self._next_s = clock.monotonic_s()

    async def turn(self) -> None:
        """Wait until a connection attempt is allowed; callers are served in order."""
        now_s = self._clock.monotonic_s()
        turn_s = max(self._next_s, now_s)
        self._next_s = turn_s + self._interval_s
        if turn_s > now_s:
            await self._clock.sleep(turn_s - now_s)


log = structlog.get_logger()

CONNECTS_PER_S = 50.0
"""Maximum rate of connection attempts over all units, if many devices return at the same time."""

CONFIG_RETRY_S = 15.0
"""Retry period, s, after a `ConfigError`: the device does not match its settings."""

ENDED = "the recording has ended"


@dataclass(frozen=True)
class Acquirer:
    """Reader of the sources of all units; it reconnects after lost links.

    Parameters
    ----------
    publish
        Coroutine function that receives each block; reading of the source waits until it returns.
    report
        Function that receives each reported link state.
    beats
        Heartbeats of the task of each unit; they continue while a device is disconnected and stop
        if its driver hangs.
    """

    units: Mapping[str, WatchedUnit]
    live: LiveView
    clock: Clock
    publish: Callable[[SampleBlock], Awaitable[None]]
    report: Callable[[LinkNews], None]
    beats: Heartbeats

    async def run(self) -> None:
        """Read until all sources have ended; an unexpected exception in one task ends all tasks."""
        acquire = partial(self._acquire, ConnectGate(CONNECTS_PER_S, self.clock))
        units = self.units.items()
        loops = {f"acquire {unit}": partial(acquire, unit, its) for unit, its in units}
        async with asyncio.TaskGroup() as sources:
            self.beats.start(loops, sources)

    async def _acquire(
        self, gate: ConnectGate, unit: str, watched: WatchedUnit, pulse: Pulse
    ) -> None:
        """Read one unit and reconnect after each lost link, until its recording ends."""
        while True:
            pulse.beat()
            await gate.turn()
            try:
                await self._read(unit, watched.source, pulse)
            except AcquisitionError as error:
                if self.live.set_link(unit, LinkState.NOT_CONNECTED, str(error)):
                    log.warning("not connected", unit=unit, reason=str(error))
                self.report(LinkNews(unit, LinkState.NOT_CONNECTED, str(error)))
                # devices that were lost together must not be reconnected at the same moment
                wait_s = watched.retry_s * random.uniform(0.5, 1.0)  # noqa: S311  not a secret
                if isinstance(error, ConfigError):
                    wait_s = CONFIG_RETRY_S
                pulse.beat(wait_s)
                await self.clock.sleep(wait_s)
            else:
                self.live.set_link(unit, LinkState.ENDED, ENDED)
                self.report(LinkNews(unit, LinkState.ENDED, ENDED))
                self.beats.release(f"acquire {unit}")
                return

    async def _read(self, unit: str, source: SampleSource, pulse: Pulse) -> None:
        resume = pulse.rest  # a source without own heartbeats may wait without limit
        if isinstance(source, TimedSource):
            source.set_pulse(pulse)
            resume = pulse.beat
        resume()
        async with source.connect() as blocks:
            async for block in blocks:
                if self.live.set_link(unit, LinkState.CONNECTED):
                    log.info("connected", unit=unit)
                    self.report(LinkNews(unit, LinkState.CONNECTED))
                pulse.rest()  # waiting for a full queue is not a fault of the source
                await self.publish(block)
                resume()
