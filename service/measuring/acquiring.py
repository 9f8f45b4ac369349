"""`Acquirer`: sources in, blocks and news of links out; the only place that retries a link."""

import asyncio
import random
from collections.abc import Awaitable, Callable, Mapping
from functools import partial

import structlog

from acquisition.clock import Clock
from acquisition.errors import AcquisitionError, ConfigError
from acquisition.source import SampleSource
from core.samples.blocks import SampleBlock
from service.live.live_view import LinkState, LiveView
from service.measuring.connect_gate import ConnectGate
from service.measuring.link_news import LinkNews
from service.measuring.watched_unit import WatchedUnit
from service.runtime.heartbeats import Audible, Heartbeats, Pulse

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
    if not isinstance(source, Audible):
        return pulse.rest
    source.listen(pulse)
    return pulse.beat


def _retry_s(error: AcquisitionError, retry_s: float) -> float:
    if isinstance(error, ConfigError):
        return CONFIG_RETRY_S
    # devices that vanish together must not be called back together
    return retry_s * random.uniform(0.5, 1.0)  # noqa: S311  not a secret
