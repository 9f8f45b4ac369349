"""A receiver's letters, in order, one at a time, each until it is settled."""

import asyncio
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Literal, TypeVar

import structlog

from acquisition.clock import Clock
from acquisition.delivery.arrival import Arrival
from core.units import ns_from_s
from service.notifications.channel import Carrier, Delivered, Failed, Outcome
from service.notifications.message import loads
from service.notifications.routing import QuietHours
from service.runtime.heartbeats import UNHEARD, Heartbeats, Pulse
from service.store.outbox import Backlog, MessageState, Outbox, StoredMessage
from service.store.port import StoreError

FIRST_S = 1.0


def wait_s(
    n_failures: int,
    retry_after_s: float | None,
    longest_s: float,
    share: Callable[[], float] = random.random,
) -> float:
    """Twice as long after each failure, up to a limit, less up to half of it by chance.

    Receivers that failed together are so not tried together.

    Parameters
    ----------
    n_failures
        In a row, 1 or more.
    retry_after_s
        What the receiver has asked for: waited for in full, up to the limit.
    share
        Chance, 0 to 1.
    """
    doubled_s = FIRST_S * 2.0 ** min(n_failures - 1, 30)
    drawn_s = min(doubled_s, longest_s) * (1.0 - 0.5 * share())
    return max(drawn_s, min(retry_after_s or 0.0, longest_s))


log = structlog.get_logger()

BATCH = 50
"""Letters that are in memory at once, whatever waits in the store."""

LOOK_S = 30.0
"""How long it waits for news before it looks by itself: another process may have revived letters,
quiet hours may have ended."""

STORE_RETRY_S = 1.0

MAX_CARRY_S = 600.0
"""Longest that a receiver may take, whatever time-outs its settings allow."""

T = TypeVar("T")


@dataclass(frozen=True)
class Receiver:
    """Somebody who is told of alarms.

    Parameters
    ----------
    name
        Of its letters in the outbox.
    kind, address
        "webhook" or "smtp", and where that is, fit to be shown.
    max_retry_s
        Longest wait between attempts.
    max_age_s
        What is older when an attempt fails is given up.
    """

    name: str
    kind: Literal["webhook", "smtp"]
    address: str
    carrier: Carrier
    max_retry_s: float = 900.0
    max_age_s: float = 259_200.0
    quiet: QuietHours | None = None


class SenderState(StrEnum):
    """What a sender does."""

    IDLE = "idle"
    SENDING = "sending"
    RETRYING = "retrying"
    QUIET = "quiet"
    STORE_FAILS = "store_fails"


@dataclass(frozen=True)
class SenderStatus:
    """How a sender fares.

    Parameters
    ----------
    n_failures
        Attempts in vain since the last answer that was of use.
    failing_since_ns
        When the first of them was; None if there is none.
    reason
        Why the newest attempt failed.
    next_attempt_ns
        When the next one is due; None unless it waits for that.
    """

    state: SenderState = SenderState.IDLE
    n_failures: int = 0
    failing_since_ns: int | None = None
    reason: str | None = None
    next_attempt_ns: int | None = None


class Sender:
    """Delivers what waits for one receiver, for ever."""

    def __init__(self, receiver: Receiver, outbox: Outbox, clock: Clock) -> None:
        self.receiver, self.status = receiver, SenderStatus()
        self._outbox, self._clock = outbox, clock
        self._begun = Arrival.now(clock)
        self._news = asyncio.Event()
        self._pulse: Pulse = UNHEARD

    def wake(self) -> None:
        """Look into the outbox now."""
        self._news.set()

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Deliver whatever comes, until cancelled."""
        self._pulse = pulse
        while True:
            self._news.clear()
            if not await self._deliver_batch():
                pulse.beat(LOOK_S)
                await self._news_or(LOOK_S)

    async def _deliver_batch(self) -> bool:
        """Deliver some letters; return whether it is worth looking for more at once."""
        name = self.receiver.name
        letters = await self._kept(lambda: self._outbox.waiting(name, BATCH))
        for letter in letters:
            if await self._is_held():
                self._note(SenderState.QUIET)
                return False
            if not await self._deliver(letter):
                return True
        if not letters:
            self._note(SenderState.IDLE)
        return bool(letters)

    async def _is_held(self) -> bool:
        quiet = self.receiver.quiet
        if quiet is None or not quiet.hold_at(self._clock.now_ns()):
            return False
        return not await self._kept(lambda: self._outbox.urgent(self.receiver.name))

    async def _deliver(self, letter: StoredMessage) -> bool:
        """Try a letter once; return whether the receiver is done with it."""
        self._note(SenderState.SENDING)
        self._pulse.beat(MAX_CARRY_S)
        outcome = await self.receiver.carrier.carry(loads(letter.body), letter.body)
        if isinstance(outcome, Failed):
            await self._wait_after(letter, outcome)
            return False
        await self._finish(letter, outcome)
        return True

    async def _finish(self, letter: StoredMessage, outcome: Outcome) -> None:
        """Write down what has come of it, also if the service is being stopped meanwhile."""
        is_delivered = isinstance(outcome, Delivered)
        state = MessageState.DELIVERED if is_delivered else MessageState.REFUSED
        now_ns = self._clock.now_ns()
        await self._kept(
            lambda: self._outbox.finish(letter.id, state, outcome.answer, now_ns), to_the_end=True
        )
        tell = log.info if is_delivered else log.error
        if not is_delivered or self.status.n_failures:
            words = "delivered again" if is_delivered else "refused for ever"
            tell(words, receiver=self.receiver.name, id=letter.event_id, answer=outcome.answer)
        self.status = SenderStatus(SenderState.SENDING)

    async def _wait_after(self, letter: StoredMessage, failed: Failed) -> None:
        now_ns, before = self._clock.now_ns(), self.status
        if before.n_failures == 0:
            log.warning("not delivered", receiver=self.receiver.name, reason=failed.answer)
        await self._kept(lambda: self._outbox.fail(letter.id, failed.answer))
        await self._expire(failed.answer)
        n_failures = before.n_failures + 1
        pause_s = wait_s(n_failures, failed.retry_after_s, self.receiver.max_retry_s)
        self.status = SenderStatus(
            state=SenderState.RETRYING,
            n_failures=n_failures,
            failing_since_ns=before.failing_since_ns or now_ns,
            reason=failed.answer,
            next_attempt_ns=now_ns + ns_from_s(pause_s),
        )
        self._pulse.beat(pause_s)
        await self._clock.sleep(pause_s)

    async def _expire(self, answer: str) -> None:
        """Give up what is too old, all of it at once: the receiver has just shown that it fails.

        A host's clock that was set forward since the start makes nothing older.
        """
        now = Arrival.now(self._clock)
        set_forward_s = max(0.0, now.step_s_since(self._begun))
        before_ns = now.host_ns - ns_from_s(set_forward_s + self.receiver.max_age_s)
        name = self.receiver.name
        words = f"too old after: {answer}"
        n_given_up = await self._kept(
            lambda: self._outbox.expire(name, before_ns, words, now.host_ns)
        )
        if n_given_up:
            log.error("given up", receiver=name, n_messages=n_given_up, reason=answer)

    async def _kept(self, work: Callable[[], T], to_the_end: bool = False) -> T:
        """Work on the store in a thread until it succeeds: nothing is sent on a guess.

        Parameters
        ----------
        to_the_end
            Whether it is finished even when this task is cancelled meanwhile.
        """
        while True:
            self._pulse.beat(STORE_RETRY_S)
            try:
                return await (_finished(work) if to_the_end else asyncio.to_thread(work))
            except StoreError as error:
                if self.status.state is not SenderState.STORE_FAILS:
                    log.error("outbox out of reach", receiver=self.receiver.name, reason=str(error))
                self._note(SenderState.STORE_FAILS)
                await self._clock.sleep(STORE_RETRY_S)

    async def _news_or(self, duration_s: float) -> None:
        waiting = [
            asyncio.create_task(self._news.wait(), name="news"),
            asyncio.create_task(self._clock.sleep(duration_s), name="look"),
        ]
        try:
            await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in waiting:
                task.cancel()
            await asyncio.wait(waiting)

    def _note(self, state: SenderState) -> None:
        self.status = replace(self.status, state=state, next_attempt_ns=None)


async def _finished(work: Callable[[], T]) -> T:
    """Work in a thread that is waited for even by a task that is cancelled."""
    working = asyncio.ensure_future(asyncio.to_thread(work))
    try:
        return await asyncio.shield(working)
    except asyncio.CancelledError:
        await asyncio.wait([working])
        if not working.cancelled():
            working.exception()  # it is being stopped: the letter is tried again after the restart
        raise


@dataclass(frozen=True)
class ReceiverView:
    """A receiver as it is shown.

    Parameters
    ----------
    receiver, status
        None of one that is in the plant file no longer; what waits for it goes on waiting.
    backlog
        None if there never was anything for it.
    """

    name: str
    receiver: Receiver | None
    status: SenderStatus | None
    backlog: Backlog | None


class Deliveries:
    """Runs a sender for each receiver; one never waits for another.

    Parameters
    ----------
    receivers
        None in a replay, which tells nobody.
    """

    def __init__(self, receivers: Sequence[Receiver], outbox: Outbox, clock: Clock) -> None:
        self._senders = [Sender(receiver, outbox, clock) for receiver in receivers]
        self._outbox, self._clock = outbox, clock

    async def run(self, beats: Heartbeats | None = None) -> None:
        """Deliver for ever."""
        beats = beats or Heartbeats(self._clock)
        loops = {f"deliver {sender.receiver.name}": sender.run for sender in self._senders}
        try:
            async with asyncio.TaskGroup() as tasks:
                for name, loop in loops.items():
                    tasks.create_task(beats.tend(name, loop), name=name)
        except asyncio.CancelledError:
            beats.release(*loops)  # another process of the plant delivers from now on
            raise

    def wake(self) -> None:
        """Say that there may be something new in the outbox."""
        for sender in self._senders:
            sender.wake()

    async def look(self) -> list[ReceiverView]:
        """Look at all receivers.

        Raises
        ------
        StoreError
            If the outbox cannot be read.
        """
        backlogs = {b.receiver: b for b in await asyncio.to_thread(self._outbox.backlogs)}
        senders = {sender.receiver.name: sender for sender in self._senders}
        return [
            ReceiverView(
                name,
                sender.receiver if sender else None,
                sender.status if sender else None,
                backlogs.get(name),
            )
            for name in (*senders, *(other for other in backlogs if other not in senders))
            for sender in [senders.get(name)]
        ]
