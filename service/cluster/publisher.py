"""Blocks to the stream: none is let go before the servers have it."""

import asyncio
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import structlog
from nats.errors import MaxPayloadError, NoRespondersError
from nats.errors import TimeoutError as NatsTimeoutError
from nats.js.api import Header
from nats.js.client import JetStreamContext
from nats.js.errors import APIError, NoStreamResponseError
from prometheus_client.metrics_core import Metric

from acquisition.clock import Clock
from acquisition.delivery.network import let_stop_through
from core.samples.blocks import SampleBlock
from core.units import ns_from_s
from service.cluster.frames import UnitIdentity, encoded_block, encoded_link
from service.cluster.session import (
    StreamError,
    StreamMisfitError,
    ensure,
    message_id,
    session,
    stream_name,
    subject,
)
from service.measuring.acquirer import LinkNews
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.metrics import counter, gauge
from service.settings.plant import PlantFile
from service.settings.processes import StreamSettings


@dataclass(frozen=True)
class Outgoing:
    """A message with its id; the id is the same whenever the same message is sent.

    Parameters
    ----------
    is_news
        Whether it tells of a link: of several in a row the last says it all.
    """

    id: str
    payload: bytes
    is_news: bool = False


class Outbound:
    """What is to be published.

    Whoever puts waits while it is full: the device's own ring buffers then, and should that
    overrun, the index of the next block shows the exact gap.

    Parameters
    ----------
    capacity
        Most bytes that wait; a message that is larger waits alone.
    """

    def __init__(self, units: Iterable[str], capacity: int, clock: Clock) -> None:
        self._waiting: dict[str, deque[Outgoing]] = {unit: deque() for unit in units}
        self._news = {unit: asyncio.Event() for unit in self._waiting}
        self._room = asyncio.Condition()
        self._clock, self._last_s = clock, clock.monotonic_s()
        self.capacity = capacity
        self.n_bytes = 0
        self.n_published = 0

    @property
    def n_waiting(self) -> int:
        """Messages that wait now."""
        return sum(len(queue) for queue in self._waiting.values())

    @property
    def behind_s(self) -> float:
        """For how long something has been waiting without anything being published."""
        return self._clock.monotonic_s() - self._last_s if self.n_waiting else 0.0

    async def put(self, unit: str, message: Outgoing) -> None:
        """Queue a message, waiting while there is no room."""
        async with self._room:
            await self._room.wait_for(lambda: self._fits(message))
            self.add(unit, message)

    def add(self, unit: str, message: Outgoing) -> None:
        """Queue a message at once; news of a link take the place of those before them."""
        queue = self._waiting[unit]
        if not self.n_waiting:
            self._last_s = self._clock.monotonic_s()
        if message.is_news and len(queue) > 1 and queue[-1].is_news:  # the first is under way
            self.n_bytes -= len(queue.pop().payload)
        queue.append(message)
        self.n_bytes += len(message.payload)
        self._news[unit].set()

    async def first(self, unit: str) -> Outgoing:
        """Wait for the oldest message of a unit; it stays until it is published."""
        while not self._waiting[unit]:
            self._news[unit].clear()
            await self._news[unit].wait()
        return self._waiting[unit][0]

    async def published(self, unit: str) -> None:
        """Let the oldest message of a unit go: the servers have it."""
        message = self._waiting[unit].popleft()
        self.n_bytes -= len(message.payload)
        self.n_published += 1
        self._last_s = self._clock.monotonic_s()
        async with self._room:
            self._room.notify_all()

    async def published_at_least(self, n_messages: int) -> None:
        """Wait until so many have been published since the start."""
        async with self._room:
            await self._room.wait_for(lambda: self.n_published >= n_messages)

    async def drained(self) -> None:
        """Wait until nothing waits."""
        async with self._room:
            await self._room.wait_for(lambda: not self.n_waiting)

    def _fits(self, message: Outgoing) -> bool:
        return not self.n_waiting or self.n_bytes + len(message.payload) <= self.capacity


log = structlog.get_logger()

RETRY_S = 1.0
MISFIT_RETRY_S = 5.0
FULL_RETRY_S = 1.0

UNCONFIRMED = "the servers do not confirm blocks: is the disk slow, or the cluster split?"
MOST_UNCONFIRMED = 3
"""Tries in a row, of all units together, before another connection is made."""

STREAM_FULL = (10047, 10077, 10023)
"""Error codes of servers: no storage left, more than the stream's most bytes, no resources."""

BYTES_PER_MB = 1e6


class Publisher:
    """Publishes what is acquired.

    Of each unit one message is under way at a time, so that they arrive in order; units do not
    wait for each other. A message that may not have arrived is sent again under the same id.

    Parameters
    ----------
    identities
        What the messages of each unit are marked with.
    """

    def __init__(
        self,
        plant: PlantFile,
        settings: StreamSettings,
        identities: Mapping[str, UnitIdentity],
        clock: Clock,
    ) -> None:
        self._plant, self._settings, self._clock = plant, settings, clock
        self._identities = identities
        self.waiting = Outbound(identities, round(settings.buffer_mb * BYTES_PER_MB), clock)
        self._links: dict[str, LinkNews] = {}
        self.trouble: str | None = "the servers have not been reached yet"
        self.n_repeated = 0
        self.n_doubles = 0
        self._n_unconfirmed = 0

    async def publish(self, block: SampleBlock) -> None:
        """Take a block, waiting while too much waits for the servers."""
        identity = self._identities[block.unit]
        message = encoded_block(block, identity, self._taken_ns(block))
        outgoing = Outgoing(message_id(identity, block), message)
        await self.waiting.put(block.unit, outgoing)

    def _taken_ns(self, block: SampleBlock) -> int:
        now_ns = self._clock.now_ns()
        if block.sampled_s is None:
            return now_ns
        return now_ns - ns_from_s(self._clock.monotonic_s() - block.sampled_s)

    def tell(self, news: LinkNews) -> None:
        """Take news of a link; what was said last is not said again."""
        if self._links.get(news.unit) == news:
            return
        self._links[news.unit] = news
        identity = self._identities[news.unit]
        id_ = f"{identity.plant.hex()[:8]}.{news.unit}.link.{self._clock.now_ns()}"
        self.waiting.add(news.unit, Outgoing(id_, encoded_link(news, identity), is_news=True))

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Publish for ever, over one connection after the other."""
        while True:
            pulse.rest()
            try:
                async with session(self._settings, "padwatch acquire") as stream:
                    await ensure(stream, self._plant, self._settings)
                    if not self._n_unconfirmed:
                        self._note(None)
                    await self._send_all(stream, pulse)
            except StreamError as error:
                self._note(str(error))
                is_misfit = isinstance(error, StreamMisfitError)
                await self._clock.sleep(MISFIT_RETRY_S if is_misfit else RETRY_S)

    async def _send_all(self, stream: JetStreamContext, pulse: Pulse) -> None:
        async with asyncio.TaskGroup() as tasks:
            for unit in self._identities:
                tasks.create_task(self._send_unit(stream, unit, pulse), name=f"publish {unit}")

    async def _send_unit(self, stream: JetStreamContext, unit: str, pulse: Pulse) -> None:
        where = subject(self._plant, unit)
        while True:
            pulse.rest()
            message = await self.waiting.first(unit)
            pulse.beat(self._settings.ack_timeout_s)
            is_sent = await self._sent(stream, where, message)
            let_stop_through()
            if is_sent:
                await self.waiting.published(unit)
            else:
                self.n_repeated += 1
                await self._clock.sleep(FULL_RETRY_S)

    async def _sent(self, stream: JetStreamContext, where: str, message: Outgoing) -> bool:
        """Send a message and wait for the servers' word; False if it is to be sent again."""
        try:
            answer = await stream.publish(
                where,
                message.payload,
                timeout=self._settings.ack_timeout_s,
                stream=stream_name(self._plant),
                headers={Header.MSG_ID: message.id},
            )
        except (NatsTimeoutError, NoRespondersError, NoStreamResponseError):
            self._note(UNCONFIRMED)
            self._n_unconfirmed += 1
            if self._n_unconfirmed % MOST_UNCONFIRMED == 0:
                # cut off from the others, a server answers all but this; the stream may be gone
                raise StreamError(UNCONFIRMED) from None
            return False
        except MaxPayloadError:
            raise StreamMisfitError(
                f"a block of {len(message.payload)} bytes is more than the servers take: raise"
                " max_payload in their file"
            ) from None
        except APIError as error:
            self._note(_refusal(error, stream_name(self._plant)))
            return False
        self._n_unconfirmed = 0
        self.n_doubles += bool(answer.duplicate)
        self._note(None)
        return True

    def _note(self, trouble: str | None) -> None:
        """Log when publishing begins or ceases to fail."""
        if trouble == self.trouble:
            return
        if trouble is None:
            log.info("blocks are being published")
        else:
            log.warning("blocks are not being published", reason=trouble)
        self.trouble = trouble


def _refusal(error: APIError, name: str) -> str:
    if error.err_code in STREAM_FULL:
        return (
            f"the stream {name!r} is full: raise [stream] max_gb or lower max_age_h; meanwhile"
            " blocks wait at the devices"
        )
    return f"the servers refuse blocks for the stream {name!r}: {error.description}"


def publisher_metrics(publisher: Publisher) -> Iterator[Metric]:
    """What waits for the servers, and what they have."""
    waiting = publisher.waiting
    yield gauge(
        "stream_connected",
        "1 while blocks are taken by the servers of the stream.",
        (),
        [((), publisher.trouble is None)],
    )
    yield counter(
        "stream_published",
        "Messages that the servers have confirmed.",
        (),
        [((), waiting.n_published)],
    )
    yield counter(
        "stream_repeated",
        "Messages that were sent again because they were not confirmed.",
        (),
        [((), publisher.n_repeated)],
    )
    yield counter(
        "stream_doubles",
        "Messages that the servers had already, and kept once.",
        (),
        [((), publisher.n_doubles)],
    )
    yield gauge(
        "stream_waiting_bytes",
        "Bytes that wait for the servers.",
        (),
        [((), waiting.n_bytes)],
    )
    yield gauge(
        "stream_waiting_share",
        "How far the memory for them is filled, 0 to 1; beyond it devices wait.",
        (),
        [((), waiting.n_bytes / waiting.capacity)],
    )
    yield gauge(
        "stream_behind_seconds",
        "For how long something has been waiting without anything being confirmed.",
        (),
        [((), waiting.behind_s)],
    )
