"""Consumer of the stream, which acknowledges a message after storing the results of its block."""

import asyncio
from collections.abc import Awaitable, Callable, Iterable, Mapping
from contextlib import suppress

from nats.aio.msg import Msg
from nats.errors import Error
from nats.errors import TimeoutError as NatsTimeoutError
from nats.js.api import AckPolicy, ConsumerConfig, DeliverPolicy
from nats.js.client import JetStreamContext
from nats.js.errors import NotFoundError

from acquisition.clock import Clock
from service.cluster.progress import UnitProgress
from service.cluster.session import (
    NOT_REACHED,
    StreamAnewError,
    consumer_name,
    keep_session,
    let_stop_through,
    require,
    stream_name,
    subject,
)
from service.measuring.recorder import Recorder
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.metrics import Families
from service.runtime.periodic import TroubleLog
from service.settings.plant import PlantFile
from service.settings.processes import StreamSettings

FETCH_S = 5.0
REST_S = 1.0
BATCH = 32
"""Maximum number of messages of a unit that are stored and acknowledged together."""

MAX_UNACKNOWLEDGED = 256
ACK_WAIT_S = 60.0

Begin = Callable[[str, int], Awaitable[Mapping[str, UnitProgress]]]
"""Function that returns the `UnitProgress` of all units on a stream, by unit id. Its arguments are
the stream's name with creation time, and the sequence number of the newest message."""


class Consumer:
    """Consumer of the stream: passes the messages of each unit to the `UnitProgress` of the unit.

    A lost connection does not interrupt the processing of messages that were already fetched.
    """

    def __init__(
        self,
        plant: PlantFile,
        settings: StreamSettings,
        begin: Begin,
        recorder: Recorder,
        clock: Clock,
    ) -> None:
        self._plant, self._settings, self._clock = plant, settings, clock
        self._begin, self._recorder = begin, recorder
        self.units: Mapping[str, UnitProgress] = {}
        self._stream: str | None = None
        self._queues: dict[str, asyncio.Queue[Msg]] = {}
        self._fetched: dict[str, int] = {}
        self._settled: dict[str, int] = {}
        self._state = TroubleLog(
            "blocks are not being read from the stream",
            "blocks are being read from the stream",
            NOT_REACHED,
        )
        self.n_pending: dict[str, int] = {}

    @property
    def trouble(self) -> str | None:
        """Reason why no blocks are read from the stream; None while they are read."""
        return self._state.trouble

    @property
    def behind_s(self) -> float:
        """Largest delay of the analysed blocks behind their devices, s."""
        return max((progress.behind_s for progress in self.units.values()), default=0.0)

    @property
    def waiting(self) -> frozenset[str]:
        """Ids of the units with fetched messages that are not being processed yet."""
        return frozenset(unit for unit, queue in self._queues.items() if not queue.empty())

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Fetch and process messages, and reconnect, until cancelled; `pulse` gets heartbeats."""
        async with asyncio.TaskGroup() as tasks:

            async def fetch_all(stream: JetStreamContext) -> None:
                await self._find(stream, tasks)
                async with asyncio.TaskGroup() as fetching:
                    for unit in self.units:
                        fetching.create_task(self._fetch_unit(stream, unit), name=f"fetch {unit}")
                    self._state.note(None)

            whose = (self._settings, "padwatch analyse")
            await keep_session(*whose, fetch_all, self._state, self._clock, pulse)

    async def _find(self, stream: JetStreamContext, tasks: asyncio.TaskGroup) -> None:
        """Check the identity of the stream; at the first call, start each unit at its position."""
        found = await require(stream, self._plant)
        state = (await stream.stream_info(stream_name(self._plant))).state
        newest = max(self._fetched.values(), default=0)
        if self._stream not in (None, found) or state.last_seq < newest:
            raise StreamAnewError(
                "the stream was replaced, or lost confirmed messages, while it was read;"
                " restart `padwatch analyse`"
            )
        if self._stream is None:
            self.units = await self._begin(found, state.last_seq)
            self._stream = found
            self._fetched = {
                unit: min(its.first_needed - 1, state.last_seq) for unit, its in self.units.items()
            }
            for unit in self.units:
                self._queues[unit] = asyncio.Queue(BATCH)
                tasks.create_task(self._take_all(unit), name=f"analyse {unit}")
        for progress in self.units.values():
            progress.reaches_back(state.first_seq)

    async def _fetch_unit(self, stream: JetStreamContext, unit: str) -> None:
        name, durable = stream_name(self._plant), consumer_name(unit)
        with suppress(NotFoundError):
            await stream.delete_consumer(name, durable)  # stops another reader of this consumer
        await stream.add_consumer(
            name,
            ConsumerConfig(
                durable_name=durable,
                filter_subject=subject(self._plant, unit),
                deliver_policy=DeliverPolicy.BY_START_SEQUENCE,
                opt_start_seq=self._fetched[unit] + 1,
                ack_policy=AckPolicy.EXPLICIT,
                ack_wait=ACK_WAIT_S,
                max_ack_pending=MAX_UNACKNOWLEDGED,
            ),
        )
        puller = await stream.pull_subscribe_bind(durable, name)
        while True:
            messages = await _fetched(puller)
            let_stop_through()
            for message in messages:
                await self._offer(unit, message)

    async def _offer(self, unit: str, message: Msg) -> None:
        sequence = message.metadata.sequence.stream
        self.n_pending[unit] = message.metadata.num_pending
        if sequence <= self._fetched[unit]:
            # redelivered: still queued here, or its acknowledgement was lost
            if sequence <= self._settled.get(unit, 0):
                with suppress(Error):
                    await message.ack()
            return
        await self._queues[unit].put(message)
        self._fetched[unit] = sequence

    async def _take_all(self, unit: str) -> None:
        """Process and acknowledge the messages of a unit, even while the connection is lost."""
        queue, progress = self._queues[unit], self.units[unit]
        while True:
            batch = [await queue.get()]
            while len(batch) < BATCH and not queue.empty():
                batch.append(queue.get_nowait())
            numbers = [message.metadata.sequence.stream for message in batch]
            pairs = zip(numbers, batch, strict=True)
            refused = [m for number, m in pairs if not await progress.take(number, m.data)]
            if not progress.is_replaying:
                position = progress.position()
                self._recorder.put([position])
                await self._recorder.reached(position)
            for message in batch:
                with suppress(Error):  # stored; an unacknowledged message is redelivered
                    await (message.term() if message in refused else message.ack())
            self._settled[unit] = numbers[-1]


async def _fetched(puller: JetStreamContext.PullSubscription) -> Iterable[Msg]:
    """Return the available messages of a consumer, up to a limit; empty after a timeout."""
    try:
        messages = await puller.fetch(1, FETCH_S)
        waiting = messages[-1].metadata.num_pending
        if waiting:
            with suppress(NatsTimeoutError):
                messages += await puller.fetch(min(waiting, BATCH), REST_S)
    except NatsTimeoutError:
        return []
    return messages


CONSUMER = {
    "stream_connected": "This is 1 while blocks are read from the stream.",
    "stream_pending": "This is the number of messages of the unit on the stream that were not"
    " fetched yet.",
    "stream_analysis_behind_seconds": "This is the delay of the newest analysed block of the unit"
    " against its device.",
    "stream_refused_total": "This counts the messages of the unit that could not be used, by"
    " reason.",
    "stream_redelivered_total": "This counts the messages of the unit that were delivered again and"
    " counted once.",
}


def add_consumer(families: Families, consumer: Consumer) -> None:
    """Add the metrics of a consumer: backlog, delay, refused and redelivered messages by unit."""
    families.declare(CONSUMER)
    families.add("stream_connected", consumer.trouble is None)
    for unit, n_pending in consumer.n_pending.items():
        families.add("stream_pending", n_pending, unit=unit)
    for unit, its in consumer.units.items():
        families.add("stream_analysis_behind_seconds", its.behind_s, unit=unit)
        families.add("stream_redelivered_total", its.n_repeated, unit=unit)
        for reason, n_refused in its.refused.items():
            families.add("stream_refused_total", n_refused, unit=unit, reason=reason)
