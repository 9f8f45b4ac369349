"""Samples before and after an alarm."""

import asyncio
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path

import structlog

from acquisition.clock import Clock
from core.alarms.alarm import ANNOUNCED, AlarmEvent, AlarmNews, AlarmState
from core.alarms.kinds import FILM_KINDS
from core.samples.blocks import SampleBlock
from core.units import ns_from_s
from service.live.samples import BlockHistory
from service.recordings.folders import clear_leftovers
from service.recordings.segment import CaptureError, CaptureFile, MakeWriter
from service.runtime.heartbeats import UNHEARD, Pulse
from service.settings.alarm_kinds import SAMPLED_KINDS


@dataclass(frozen=True)
class Outcome:
    """What has become of a capture.

    Parameters
    ----------
    folder
        Where it is; None if it could not be written.
    reason
        Why not.
    """

    alarms: Sequence[AlarmEvent]
    folder: Path | None
    reason: str | None = None


def unheeded(_: Outcome) -> None:
    """Nobody wants to know."""


@dataclass(frozen=True)
class CaptureSettings:
    """How much is kept around an alarm.

    Parameters
    ----------
    pre_s, post_s
        Before the alarm and after it.
    max_s
        Longest capture.
    window_s
        Length of an averaging window: as much is kept before an alarm of a film.
    """

    pre_s: float = 60.0
    post_s: float = 120.0
    max_s: float = 600.0
    window_s: float = 0.0

    @property
    def longest_pre_s(self) -> float:
        """How much before an alarm is kept at most, so that what follows it fits in too."""
        return max(self.pre_s, min(self.window_s, self.max_s - self.post_s))

    def pre_of(self, kind: str) -> float:
        """How much is kept before an alarm of a kind."""
        return self.longest_pre_s if kind in FILM_KINDS else self.pre_s


def is_captured(event: AlarmEvent) -> bool:
    """Whether samples are kept around an event: a new occurrence that nothing hides."""
    return (
        event.change in ANNOUNCED
        and event.identity.kind in SAMPLED_KINDS
        and event.state_after is AlarmState.UNACKNOWLEDGED
    )


@dataclass(frozen=True)
class Span:
    """From when to when, in the time of the samples. Only whole blocks are kept.

    Parameters
    ----------
    n_samples
        Taken so far, per channel.
    max_samples
        Most that are taken, should the device's time stand still or run backwards.
    """

    start_ns: int
    end_ns: int
    last_end_ns: int
    max_samples: int
    n_samples: int = 0

    @classmethod
    def around(cls, event: AlarmEvent, rate_hz: float, settings: CaptureSettings) -> "Span":
        """The span around an alarm."""
        time_ns = event.time_ns
        start_ns = time_ns - ns_from_s(settings.pre_of(event.identity.kind))
        last_end_ns = start_ns + ns_from_s(settings.max_s)
        end_ns = time_ns + ns_from_s(settings.post_s)
        return cls(start_ns, end_ns, last_end_ns, round(settings.max_s * rate_hz))

    def reaches_back_to(self, start_ns: int, oldest_ns: int) -> bool:
        """Whether it begins by a time, or at least with the oldest samples that there are."""
        return self.start_ns <= max(start_ns, oldest_ns)

    def with_alarm(self, time_ns: int, settings: CaptureSettings) -> "Span":
        """The span prolonged by one more alarm, as far as that goes."""
        end_ns = max(self.end_ns, time_ns + ns_from_s(settings.post_s))
        return replace(self, end_ns=min(end_ns, self.last_end_ns))

    def with_block(self, block: SampleBlock) -> "Span":
        """The span when a block has been taken."""
        return replace(self, n_samples=self.n_samples + block.n_samples)

    def begins_by(self, block: SampleBlock) -> bool:
        """Whether a block from before the alarm belongs to it, if only in part."""
        return block.stop_ns > self.start_ns

    def goes_on_to(self, block: SampleBlock) -> bool:
        """Whether a block that follows belongs to it, if only in part."""
        return block.start_ns < self.end_ns and self.n_samples < self.max_samples

    def is_over(self, newest: SampleBlock) -> bool:
        """Whether nothing that follows a block can belong to it."""
        return newest.stop_ns >= self.end_ns or self.n_samples >= self.max_samples


@dataclass
class Capture:
    """One capture that is being made.

    Parameters
    ----------
    alarms
        The events it is made for; the first has begun it.
    deadline_s
        When it is finished with what there is, on the steady clock.
    pending
        Blocks that are still to be written; filled on the event loop, emptied in the thread.
    is_lost
        Whether the disk was too slow for it.
    is_replaced
        Whether another one holds all of it, and more.
    """

    file: CaptureFile
    span: Span
    alarms: list[AlarmEvent]
    deadline_s: float
    pending: deque[SampleBlock] = field(default_factory=deque)
    is_lost: bool = False
    is_replaced: bool = False

    def add(self, block: SampleBlock) -> None:
        """Take a block, if it belongs here."""
        if self.span.goes_on_to(block) and not self.is_lost:
            self.pending.append(block)
            self.span = self.span.with_block(block)

    @property
    def n_pending_samples(self) -> int:
        """Samples of all channels that are still to be written."""
        return len(self.pending) * self.pending[0].counts.size if self.pending else 0


log = structlog.get_logger()

WRITE_EVERY_S = 0.5

PATIENCE_S = 30.0
"""How much longer than its time a capture waits for samples that no longer come."""

MAX_BUSY_S = 60.0
"""Longest that the disk may take for what is handed to it at once."""

MAX_PENDING_SAMPLES = 50_000_000
"""Of all channels and captures together that wait for the disk: 200 MB."""


class Captures:
    """Histories and captures of all units; told of every block, writes in a thread of its own.

    Parameters
    ----------
    root
        Folder of all captures.
    make_writer
        Opens a recording, by unit; without it nothing is kept of a unit.
    rate_hz
        Of each unit that has a writer.

    Attributes
    ----------
    error
        Why the last capture could not be written; None since one could.
    n_written, n_failed
        Captures finished, and attempts to write them that failed, since the start.
    """

    def __init__(
        self,
        root: Path,
        settings: CaptureSettings,
        make_writer: Mapping[str, MakeWriter],
        rate_hz: Mapping[str, float],
        clock: Clock,
    ) -> None:
        self._root, self._settings, self._clock = root, settings, clock
        self._make_writer, self._rate_hz = make_writer, rate_hz
        self._histories = {
            unit: BlockHistory(round(settings.longest_pre_s * rate))
            for unit, rate in rate_hz.items()
        }
        self._running: dict[str, Capture] = {}
        self._ended: list[Capture] = []
        self._news = asyncio.Event()
        self._ready: Callable[[Outcome], None] = unheeded
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="captures")
        self._busy_since_s: float | None = None
        self.error: str | None = None
        self.n_written = self.n_failed = 0

    def tell(self, ready: Callable[[Outcome], None]) -> None:
        """Tell somebody, on the event loop, what becomes of each capture."""
        self._ready = ready

    def expects(self, event: AlarmEvent) -> bool:
        """Whether samples are kept around an event."""
        return is_captured(event) and event.identity.unit in self._histories

    @property
    def being_made(self) -> frozenset[tuple[str, int]]:
        """Alarms and occurrences around which samples are being written now."""
        events = (event for capture in self._all for event in capture.alarms)
        return frozenset((event.identity.id, event.occurrence) for event in events)

    @property
    def n_running(self) -> int:
        """Captures that are being made now."""
        return len(self._all)

    @property
    def trouble(self) -> str | None:
        """Why samples are not kept now: an error, or a disk that does not answer."""
        since_s = self._busy_since_s
        if since_s is not None and self._clock.monotonic_s() - since_s > MAX_BUSY_S:
            return "the disk does not answer"
        return self.error

    @property
    def _all(self) -> list[Capture]:
        return [*self._ended, *self._running.values()]

    def take(self, block: SampleBlock, news: Sequence[AlarmNews]) -> None:
        """Take in a block with the news that it has brought."""
        if block.unit not in self._histories:
            return
        is_new = self._histories[block.unit].add(block)
        events = [e for told in news for e in told.events if is_captured(e)]
        running = self._running.get(block.unit)
        if running is None and not events:
            return
        if running is None:
            running = self._begin(block.unit, events)
        elif not self._reaches_back(running, block.unit, events):
            running = self._replace(block.unit, events)
        else:
            self._prolong(running, events)
            if is_new:
                running.add(block)
        if running.span.is_over(block):
            self._end(block.unit)
        elif sum(each.n_pending_samples for each in self._all) > MAX_PENDING_SAMPLES:
            self._give_up(block.unit)
        self._news.set()

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Write what is to be written, for ever; afterwards `close`."""
        pulse.beat(MAX_BUSY_S)
        await self._in_thread(self._clear)
        while True:
            pulse.rest()
            await self._news.wait()
            self._news.clear()
            while self._all:
                pulse.beat(MAX_BUSY_S)
                self._end_idle()
                await self._write()
                await self._clock.sleep(WRITE_EVERY_S)

    async def close(self) -> None:
        """Finish what is being made, with what there is, and let go of the thread."""
        for unit in list(self._running):
            self._end(unit)
        await self._write()
        self._thread.shutdown(wait=False)

    def _begin(self, unit: str, events: list[AlarmEvent]) -> Capture:
        first = events[0]
        capture = Capture(
            file=CaptureFile(self._root, first, self._make_writer[unit]),
            span=self._span_around(unit, events),
            alarms=[],
            deadline_s=0.0,
        )
        self._prolong(capture, events)
        for block in self._histories[unit]:
            if capture.span.begins_by(block):
                capture.add(block)
        self._running[unit] = capture
        return capture

    def _reaches_back(self, capture: Capture, unit: str, events: Sequence[AlarmEvent]) -> bool:
        """Whether it has what belongs before all of these events."""
        oldest_ns = next(iter(self._histories[unit])).start_ns
        return not events or capture.span.reaches_back_to(
            self._span_around(unit, events).start_ns, oldest_ns
        )

    def _replace(self, unit: str, events: list[AlarmEvent]) -> Capture:
        """Begin again, from further back, with the alarms that there have been."""
        before = self._running[unit]
        before.is_replaced, before.pending = True, deque()
        self._end(unit)
        return self._begin(unit, [*before.alarms, *events])

    def _span_around(self, unit: str, events: Sequence[AlarmEvent]) -> Span:
        """The span that begins first."""
        spans = (Span.around(event, self._rate_hz[unit], self._settings) for event in events)
        return min(spans, key=lambda span: span.start_ns)

    def _prolong(self, capture: Capture, events: Sequence[AlarmEvent]) -> None:
        for event in events:
            capture.alarms.append(event)
            capture.span = capture.span.with_alarm(event.time_ns, self._settings)
            patience_s = self._settings.post_s + PATIENCE_S
            capture.deadline_s = self._clock.monotonic_s() + patience_s

    def _end(self, unit: str) -> None:
        self._ended.append(self._running.pop(unit))

    def _end_idle(self) -> None:
        """End what waits for samples that do not come."""
        now_s = self._clock.monotonic_s()
        for unit, capture in list(self._running.items()):
            if now_s > capture.deadline_s:
                self._end(unit)

    def _give_up(self, unit: str) -> None:
        """Let go of a capture that the disk cannot keep up with."""
        capture = self._running[unit]
        # another one, as the thread may be emptying this one
        capture.is_lost, capture.pending = True, deque()
        self._end(unit)

    async def _write(self) -> None:
        """Hand everything to the thread; what is over is finished there."""
        for capture in self._all:
            is_last = any(capture is ended for ended in self._ended)
            was_closed = capture.file.is_closed
            await self._in_thread(self._put, capture, is_last)
            if is_last:
                self._ended = [each for each in self._ended if each is not capture]
            if not was_closed and not capture.is_replaced and (is_last or capture.file.is_closed):
                self._ready(Outcome(tuple(capture.alarms), capture.file.finished, self.error))
        self._running = {u: c for u, c in self._running.items() if not c.file.is_closed}

    def _put(self, capture: Capture, is_last: bool) -> None:
        """Write what is pending; in the thread."""
        try:
            if capture.is_replaced:
                capture.file.given_up("another one holds them")
                return
            capture.file.write(_drained(capture.pending))
            if is_last and not capture.file.is_closed:
                if capture.is_lost:
                    raise capture.file.given_up("the disk is too slow for them")
                capture.file.finish(capture.alarms)
                self.n_written += 1
                self._tell(None)
        except (CaptureError, OSError) as error:
            self.n_failed += 1
            self._tell(str(error))

    def _clear(self) -> None:
        """Remove what a crash has left; in the thread."""
        try:
            for folder in clear_leftovers(self._root, self._histories):
                log.warning("an unfinished capture is removed", folder=folder.name)
        except OSError as error:
            self._tell(str(error))

    def _tell(self, error: str | None) -> None:
        if error is not None and error != self.error:
            log.error("samples around alarms are not kept", reason=error)
        if error is None and self.error is not None:
            log.info("samples around alarms are kept again")
        self.error = error

    async def _in_thread(self, do: Callable[..., None], *arguments: object) -> None:
        self._busy_since_s = self._clock.monotonic_s()
        await asyncio.get_running_loop().run_in_executor(self._thread, do, *arguments)
        self._busy_since_s = None


def _drained(pending: deque[SampleBlock]) -> list[SampleBlock]:
    blocks = []
    while pending:
        blocks.append(pending.popleft())
    return blocks
