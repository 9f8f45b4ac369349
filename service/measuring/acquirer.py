"""Sources to blocks and news of links, handed over within bounded memory."""

import asyncio
import random
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from dataclasses import dataclass
from functools import partial

import structlog

from acquisition.clock import Clock
from acquisition.errors import AcquisitionError, ConfigError
from acquisition.source import SampleSource
from core.samples.blocks import SampleBlock
from service.live.live_view import LinkState, LiveView
from service.measuring.sources import WatchedUnit
from service.runtime.heartbeats import Heartbeats, Pulse
from service.runtime.polls import TimedSource


@dataclass(frozen=True)
class LinkNews:
    """The link to a unit's device is up, has failed, or its recording has ended.

    Parameters
    ----------
    reason
        Why there are no samples, in words; None while there are.
    """

    unit: str
    state: LinkState
    reason: str | None = None

    @property
    def is_connected(self) -> bool:
        """Whether samples arrive."""
        return self.state is LinkState.CONNECTED


class Bus:
    """A queue of sample blocks within one process.

    A full bus makes publishers wait: a device's own ring then buffers, and should it overrun, the
    sample index shows the exact gap. Nothing is dropped here.

    Parameters
    ----------
    capacity
        Most blocks that wait.
    """

    def __init__(self, capacity: int, clock: Clock) -> None:
        self._queue: asyncio.Queue[SampleBlock] = asyncio.Queue(capacity)
        self._clock = clock
        self._published_s: deque[float] = deque()
        self.capacity = capacity
        self.n_published = 0

    @property
    def depth(self) -> int:
        """Blocks waiting now."""
        return self._queue.qsize()

    @property
    def oldest_wait_s(self) -> float:
        """For how long the oldest block that is not dealt with has been here."""
        if not self._published_s:
            return 0.0
        return self._clock.monotonic_s() - self._published_s[0]

    async def publish(self, block: SampleBlock) -> None:
        """Hand a block over, waiting while the bus is full."""
        await self._queue.put(block)
        self._published_s.append(self._clock.monotonic_s())
        self.n_published += 1

    async def blocks(self) -> AsyncIterator[SampleBlock]:
        """All blocks in the order they were published, for ever."""
        while True:
            yield await self._queue.get()

    def done(self) -> None:
        """Say that the block taken last has been dealt with."""
        self._queue.task_done()
        self._published_s.popleft()

    async def drained(self) -> None:
        """Wait until every published block has been dealt with."""
        await self._queue.join()


class ConnectGate:
    """Lets attempts at a connection through one after the other, evenly spaced.

    Parameters
    ----------
    per_s
        Most attempts in a second, over all links.
    """

    def __init__(self, per_s: float, clock: Clock) -> None:
        self._interval_s = 1.0 / per_s
        self._clock = clock
        self._next_s = clock.monotonic_s()

    async def turn(self) -> None:
        """Wait for one's turn; first come, first served."""
        now_s = self._clock.monotonic_s()
        turn_s = max(self._next_s, now_s)
        self._next_s = turn_s + self._interval_s
        if turn_s > now_s:
            await self._clock.sleep(turn_s - now_s)


log = structlog.get_logger()

CONNECTS_PER_S = 50.0
"""Over all units, so that a hundred devices that come back together are not stormed."""

CONFIG_RETRY_S = 15.0
"""A device that cannot fit the settings may be replaced or reconfigured, but not in seconds."""

ENDED = "the recording has ended"

Publish = Callable[[SampleBlock], Awaitable[None]]
"""Takes a block, and makes the source wait while it cannot."""


class Acquirer:
    """Reads all units.

    Parameters
    ----------
    publish
        Where blocks go.
    tell
        Hears of links: of one that is up once, of one that is not each time that it is tried.
    beats
        Listens to the task that reads each unit: a device that is away is tried again and again,
        which is heard; a driver that hangs is not.
    """

    def __init__(
        self,
        units: Mapping[str, WatchedUnit],
        live: LiveView,
        clock: Clock,
        publish: Publish,
        tell: Callable[[LinkNews], None],
        beats: Heartbeats | None = None,
    ) -> None:
        self._units, self._live, self._clock = units, live, clock
        self._publish, self._tell = publish, tell
        self._gate = ConnectGate(CONNECTS_PER_S, clock)
        self._beats = beats or Heartbeats(clock)

    async def run(self) -> None:
        """Read until every source has come to its end. A bug in reading one ends them all."""
        async with asyncio.TaskGroup() as sources:
            for unit, watched in self._units.items():
                name = f"acquire {unit}"
                acquire = partial(self._acquire, unit, watched)
                sources.create_task(self._beats.tend(name, acquire), name=name)

    async def _acquire(self, unit: str, watched: WatchedUnit, pulse: Pulse) -> None:
        """Read one unit for ever; a lost link is tried again and again."""
        while True:
            pulse.beat()
            await self._gate.turn()
            try:
                await self._read(unit, watched.source, pulse)
            except AcquisitionError as error:
                self._note_failure(unit, error)
                wait_s = _retry_s(error, watched.retry_s)
                pulse.beat(wait_s)
                await self._clock.sleep(wait_s)
            else:
                self._live.set_link(unit, LinkState.ENDED, ENDED)
                self._tell(LinkNews(unit, LinkState.ENDED, ENDED))
                self._beats.release(f"acquire {unit}")
                return

    async def _read(self, unit: str, source: SampleSource, pulse: Pulse) -> None:
        resume = _listening(source, pulse)
        resume()
        async with source.connect() as blocks:
            async for block in blocks:
                if self._live.set_link(unit, LinkState.CONNECTED):
                    log.info("connected", unit=unit)
                    self._tell(LinkNews(unit, LinkState.CONNECTED))
                pulse.rest()  # a full bus is the analysis' trouble
                await self._publish(block)
                resume()

    def _note_failure(self, unit: str, error: AcquisitionError) -> None:
        if self._live.set_link(unit, LinkState.NOT_CONNECTED, str(error)):
            log.warning("not connected", unit=unit, reason=str(error))
        self._tell(LinkNews(unit, LinkState.NOT_CONNECTED, str(error)))


def _listening(source: SampleSource, pulse: Pulse) -> Callable[[], None]:
    """What to say before a source is waited for; one that cannot be heard may take for ever."""
    if not isinstance(source, TimedSource):
        return pulse.rest
    source.set_pulse(pulse)
    return pulse.beat


def _retry_s(error: AcquisitionError, retry_s: float) -> float:
    if isinstance(error, ConfigError):
        return CONFIG_RETRY_S
    # devices that vanish together must not be called back together
    return retry_s * random.uniform(0.5, 1.0)  # noqa: S311  not a secret
