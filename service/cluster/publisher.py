"""Publisher of sample blocks on the stream, which queues each until the servers confirm it."""

import asyncio
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from nats.errors import MaxPayloadError, NoRespondersError
from nats.errors import TimeoutError as NatsTimeoutError
from nats.js.api import Header
from nats.js.client import JetStreamContext
from nats.js.errors import APIError, NoStreamResponseError

from acquisition.clock import Clock
from core.samples.blocks import SampleBlock
from core.units import ns_from_s
from service.cluster.frames import UnitIdentity, encoded_block, encoded_link
from service.cluster.session import (
    NOT_REACHED,
    StreamError,
    StreamMisfitError,
    ensure,
    keep_session,
    let_stop_through,
    message_id,
    stream_name,
    subject,
)
from service.measuring.acquirer import LinkNews
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.metrics import Families
from service.runtime.periodic import TroubleLog
from service.settings.plant import PlantFile
from service.settings.processes import StreamSettings


@dataclass(frozen=True)
class Outgoing:
    """Message to publish, with the same id in all attempts; `is_news` marks a link state."""

    id: str
    payload: bytes
    is_news: bool = False


class _Outbound:
    """Queues of messages to publish, one for each unit, with a common capacity in bytes.

    `put` waits if a message would exceed ``capacity``. Meanwhile the ring of the device buffers
    samples; if the ring overruns, the sample index of the next block shows the exact gap.
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
        """Number of queued messages of all units."""
        return sum(len(queue) for queue in self._waiting.values())

    @property
    def behind_s(self) -> float:
        """Time since the servers last confirmed a message, s; 0 while the queue is empty."""
        return self._clock.monotonic_s() - self._last_s if self.n_waiting else 0.0

    async def put(self, unit: str, message: Outgoing) -> None:
        """Queue a message; wait until it fits the capacity or all queues are empty."""
        async with self._room:
            await self._room.wait_for(lambda: self._fits(message))
            self.add(unit, message)

    def add(self, unit: str, message: Outgoing) -> None:
        """Queue a message without waiting; a link state replaces one queued just before it."""
        queue = self._waiting[unit]
        if not self.n_waiting:
            self._last_s = self._clock.monotonic_s()
        if message.is_news and len(queue) > 1 and queue[-1].is_news:  # the first is in transit
            self.n_bytes -= len(queue.pop().payload)
        queue.append(message)
        self.n_bytes += len(message.payload)
        self._news[unit].set()

    async def first(self, unit: str) -> Outgoing:
        """Wait for the oldest message of a unit and return it; `published` removes it later."""
        while not self._waiting[unit]:
            self._news[unit].clear()
            await self._news[unit].wait()
        return self._waiting[unit][0]

    async def published(self, unit: str) -> None:
        """Remove the oldest message of a unit; call it once the servers have acknowledged it."""
        message = self._waiting[unit].popleft()
        self.n_bytes -= len(message.payload)
        self.n_published += 1
        self._last_s = self._clock.monotonic_s()
        async with self._room:
            self._room.notify_all()

    async def drained(self) -> None:
        """Wait until the queues of all units are empty."""
        async with self._room:
            await self._room.wait_for(lambda: not self.n_waiting)

    def _fits(self, message: Outgoing) -> bool:
        return not self.n_waiting or self.n_bytes + len(message.payload) <= self.capacity


FULL_RETRY_S = 1.0

UNCONFIRMED = "the NATS servers do not confirm blocks; check their disks and the cluster"
MAX_UNCONFIRMED = 3
"""Number of consecutive unconfirmed attempts after which the connection is renewed."""

STREAM_FULL = (10047, 10077, 10023)
"""JetStream error codes: no storage, maximum bytes exceeded, insufficient resources."""

BYTES_PER_MB = 1e6


class Publisher:
    """Publisher of the blocks and link states of all units on the stream.

    One message per unit is sent at a time, so that the messages of a unit arrive in order. A
    message that is not acknowledged is sent again with the same id.
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
        self.waiting = _Outbound(identities, round(settings.buffer_mb * BYTES_PER_MB), clock)
        self._links: dict[str, LinkNews] = {}
        self._state = TroubleLog(
            "blocks are not being published", "blocks are being published", NOT_REACHED
        )
        self.n_repeated = 0
        self.n_doubles = 0
        self._n_unconfirmed = 0

    @property
    def trouble(self) -> str | None:
        """Reason why blocks are not being published; None while they are published."""
        return self._state.trouble

    async def publish(self, block: SampleBlock) -> None:
        """Queue a block; wait while the queue is full. Raises `ValueError` if it is too large."""
        identity = self._identities[block.unit]
        taken_ns = self._clock.now_ns()
        if block.sampled_s is not None:
            taken_ns -= ns_from_s(self._clock.monotonic_s() - block.sampled_s)
        message = encoded_block(block, identity, taken_ns)
        await self.waiting.put(block.unit, Outgoing(message_id(identity, block), message))

    def publish_link(self, news: LinkNews) -> None:
        """Queue the link state of a unit if it has changed."""
        if self._links.get(news.unit) == news:
            return
        self._links[news.unit] = news
        identity = self._identities[news.unit]
        id_ = f"{identity.plant.hex()[:8]}.{news.unit}.link.{self._clock.now_ns()}"
        self.waiting.add(news.unit, Outgoing(id_, encoded_link(news, identity), is_news=True))

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Publish queued messages, and reconnect, until cancelled; `pulse` gets heartbeats."""

        async def send_all(stream: JetStreamContext) -> None:
            await ensure(stream, self._plant, self._settings)
            if not self._n_unconfirmed:
                self._state.note(None)
            async with asyncio.TaskGroup() as tasks:
                for unit in self._identities:
                    sending = self._send_unit(stream, unit, pulse)
                    tasks.create_task(sending, name=f"publish {unit}")

        whose = (self._settings, "padwatch acquire")
        await keep_session(*whose, send_all, self._state, self._clock, pulse)

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
        """Send a message and wait for its confirmation; return False if it must be sent again."""
        name = stream_name(self._plant)
        try:
            answer = await stream.publish(
                where,
                message.payload,
                timeout=self._settings.ack_timeout_s,
                stream=name,
                headers={Header.MSG_ID: message.id},
            )
        except (NatsTimeoutError, NoRespondersError, NoStreamResponseError):
            self._state.note(UNCONFIRMED)
            self._n_unconfirmed += 1
            if self._n_unconfirmed % MAX_UNCONFIRMED == 0:
                # without a quorum, a server still answers other requests; the stream may not exist
                raise StreamError(UNCONFIRMED) from None
            return False
        except MaxPayloadError:
            raise StreamMisfitError(
                f"a block has {len(message.payload)} bytes, more than the servers accept; raise"
                " max_payload in the configuration of NATS"
            ) from None
        except APIError as error:
            words = f"the NATS servers reject blocks for the stream '{name}': {error.description}"
            if error.err_code in STREAM_FULL:
                words = (
                    f"the stream '{name}' is full: raise [stream] max_gb or lower max_age_h;"
                    " meanwhile blocks wait at the devices"
                )
            self._state.note(words)
            return False
        self._n_unconfirmed = 0
        self.n_doubles += bool(answer.duplicate)
        self._state.note(None)
        return True


PUBLISHER = {
    "stream_connected": "This is 1 while the servers of the stream accept blocks.",
    "stream_published_total": "This counts the messages that the servers have confirmed.",
    "stream_repeated_total": "This counts the messages that were sent again because they were not"
    " confirmed.",
    "stream_doubles_total": "This counts the messages that the servers already had.",
    "stream_waiting_bytes": "This is the number of bytes that wait for the servers.",
    "stream_waiting_share": "This is the filled share of the queue, 0 to 1; devices wait when it is"
    " full.",
    "stream_behind_seconds": "This is the time for which messages have waited without any being"
    " confirmed.",
}


def add_publisher(families: Families, publisher: Publisher) -> None:
    """Add the metrics of a publisher: connection, queues, published and repeated messages."""
    families.declare(PUBLISHER)
    waiting = publisher.waiting
    families.add("stream_connected", publisher.trouble is None)
    families.add("stream_published_total", waiting.n_published)
    families.add("stream_repeated_total", publisher.n_repeated)
    families.add("stream_doubles_total", publisher.n_doubles)
    families.add("stream_waiting_bytes", waiting.n_bytes)
    families.add("stream_waiting_share", waiting.n_bytes / waiting.capacity)
    families.add("stream_behind_seconds", waiting.behind_s)
