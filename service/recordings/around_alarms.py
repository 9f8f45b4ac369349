"""Captures: recordings of the samples before and after an alarm."""

import asyncio
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import structlog

from acquisition.clock import Clock
from core.alarms.alarm import ANNOUNCED, AlarmEvent, AlarmNews, AlarmState
from core.alarms.kinds import FILM_STIFFNESS
from core.samples.blocks import SampleBlock
from core.units import ns_from_s
from service.live.samples import BlockHistory
from service.recordings.folders import remove_incomplete
from service.recordings.segment import CaptureError, CaptureFile, MakeWriter, WriterThread
from service.runtime.heartbeats import UNHEARD, Pulse
from service.settings.alarm_kinds import SAMPLED_KINDS


@dataclass(frozen=True)
class Outcome:
    """Result of a capture: the recording, or the reason why it was not written.

    Parameters
    ----------
    alarms
        Alarm events that the capture covers.
    folder
        Folder of the capture; None if the capture could not be written.
    reason
        Reason why the capture could not be written; None if it was written.
    """

    alarms: Sequence[AlarmEvent]
    folder: Path | None
    reason: str | None = None


@dataclass(frozen=True)
class CaptureSettings:
    """Durations of a capture, in seconds.

    Parameters
    ----------
    pre_s, post_s
        Durations before and after the alarm.
    max_s
        Maximum duration of a capture.
    window_s
        Averaging time of film readings, recorded before a film alarm as far as `max_s` permits.
    """

    pre_s: float = 60.0
    post_s: float = 120.0
    max_s: float = 600.0
    window_s: float = 0.0

    @property
    def longest_pre_s(self) -> float:
        """Duration recorded before a film alarm, in s, which is at least that of other alarms."""
        return max(self.pre_s, min(self.window_s, self.max_s - self.post_s))

    def start_ns(self, event: AlarmEvent) -> int:
        """Return the start time, in ns since 1970 UTC, of the capture of an alarm event."""
        is_film = event.identity.kind == FILM_STIFFNESS
        return event.time_ns - ns_from_s(self.longest_pre_s if is_film else self.pre_s)


def is_captured(event: AlarmEvent) -> bool:
    """Return whether samples around an alarm event are captured.

    They are if the event raises or escalates an alarm that is not shelved or suppressed, and if
    captures are made for this kind of alarm.
    """
    return (
        event.change in ANNOUNCED
        and event.identity.kind in SAMPLED_KINDS
        and event.state_after is AlarmState.UNACKNOWLEDGED
    )


class Capture:
    """Capture in progress, which consists of whole sample blocks.

    Parameters
    ----------
    start_ns
        Start time of the capture, by the time stamps of the samples.
    max_samples
        Maximum number of samples per channel, which applies if the time stamps stop or decrease.

    Attributes
    ----------
    alarms
        Alarm events that the capture covers; the first event started the capture.
    deadline_s
        Monotonic time, in s, at which the capture is finished if no further samples arrive.
    pending
        Blocks to be written; added on the event loop and written in the writer thread.
    is_lost
        Whether the capture is abandoned because the disk is too slow.
    is_replaced
        Whether the capture is abandoned because a newer capture contains its samples.
    """

    def __init__(
        self, file: CaptureFile, start_ns: int, max_samples: int, settings: CaptureSettings
    ) -> None:
        self.file, self.start_ns, self._settings = file, start_ns, settings
        self._end_ns, self._last_end_ns = start_ns, start_ns + ns_from_s(settings.max_s)
        self._n_left = max_samples
        self.alarms: list[AlarmEvent] = []
        self.deadline_s = 0.0
        self.pending: deque[SampleBlock] = deque()
        self.is_lost = self.is_replaced = False

    def extend(self, event: AlarmEvent, now_s: float) -> None:
        """Add an alarm event at monotonic time `now_s`; extend the capture to `post_s` after it."""
        self.alarms.append(event)
        end_ns = max(self._end_ns, event.time_ns + ns_from_s(self._settings.post_s))
        self._end_ns = min(end_ns, self._last_end_ns)
        self.deadline_s = now_s + self._settings.post_s + PATIENCE_S

    def add(self, block: SampleBlock) -> None:
        """Append a block, unless it starts after the end or the capture is full or abandoned."""
        if block.start_ns < self._end_ns and self._n_left > 0 and not self.is_lost:
            self.pending.append(block)
            self._n_left -= block.n_samples

    def is_over(self, newest: SampleBlock) -> bool:
        """Return whether the capture is complete once it contains the newest block."""
        return newest.stop_ns >= self._end_ns or self._n_left <= 0

    @property
    def n_pending_samples(self) -> int:
        """Number of samples still to be written, summed over the channels."""
        return len(self.pending) * self.pending[0].counts.size if self.pending else 0


log = structlog.get_logger()

WRITE_EVERY_S = 0.5

PATIENCE_S = 30.0
"""Time in seconds that a capture waits for late samples after its end."""

MAX_BUSY_S = 60.0
"""Maximum duration of one write, in seconds."""

MAX_PENDING_SAMPLES = 50_000_000
"""Maximum number of samples to be written, summed over channels and captures: 200 MB."""


class Captures(WriterThread):
    """Recorder of captures of all units; keeps the newest blocks of each unit in memory.

    Parameters
    ----------
    make_writer
        Function that opens a recording, by unit; other units are not captured.
    rate_hz
        Sampling rate, by unit, of the units in `make_writer`.

    Attributes
    ----------
    n_written, n_failed
        Numbers of finished captures and of failed writes since the start.
    """

    def __init__(
        self,
        root: Path,
        settings: CaptureSettings,
        make_writer: Mapping[str, MakeWriter],
        rate_hz: Mapping[str, float],
        clock: Clock,
    ) -> None:
        super().__init__("captures", "samples around alarms", clock)
        self._root, self._settings = root, settings
        self._make_writer, self._rate_hz = make_writer, rate_hz
        self._histories = {
            unit: BlockHistory(round(settings.longest_pre_s * rate))
            for unit, rate in rate_hz.items()
        }
        self._running: dict[str, Capture] = {}
        self._ended: list[Capture] = []
        self._news = asyncio.Event()
        self._listener: Callable[[Outcome], None] = lambda _: None
        self.n_written = self.n_failed = 0

    def set_listener(self, listener: Callable[[Outcome], None]) -> None:
        """Set the function that is called on the event loop with the outcome of each capture."""
        self._listener = listener

    def expects(self, event: AlarmEvent) -> bool:
        """Return whether the samples around an event are going to be recorded."""
        return is_captured(event) and event.identity.unit in self._histories

    @property
    def being_made(self) -> frozenset[tuple[str, int]]:
        """Alarm id and occurrence of each event whose capture is being written."""
        events = (event for capture in self._all for event in capture.alarms)
        return frozenset((event.identity.id, event.occurrence) for event in events)

    @property
    def n_running(self) -> int:
        """Number of captures that are being written."""
        return len(self._all)

    @property
    def trouble(self) -> str | None:
        """Reason why captures are not written, such as a disk without response; None otherwise."""
        since_s = self._busy_since_s
        if since_s is not None and self._clock.monotonic_s() - since_s > MAX_BUSY_S:
            return "the disk does not respond"
        return self.error

    @property
    def _all(self) -> list[Capture]:
        return [*self._ended, *self._running.values()]

    def take(self, block: SampleBlock, news: Sequence[AlarmNews]) -> None:
        """Keep a block in memory; start, extend or replace a capture for the alarms in `news`."""
        if block.unit not in self._histories:
            return
        is_new = self._histories[block.unit].add(block)
        events = [e for each in news for e in each.events if is_captured(e)]
        running = self._running.get(block.unit)
        if running is None and not events:
            return
        if running is None:
            running = self._begin(block.unit, events)
        elif events and not self._reaches_back(running, block.unit, events):
            running = self._replace(block.unit, events)
        else:
            self._extend(running, events)
            if is_new:
                running.add(block)
        if running.is_over(block):
            self._end(block.unit)
        elif sum(each.n_pending_samples for each in self._all) > MAX_PENDING_SAMPLES:
            # a new deque: the thread may be emptying the old one
            running.is_lost, running.pending = True, deque()
            self._end(block.unit)
        self._news.set()

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Write pending blocks until cancelled, with heartbeats to `pulse`; then call `close`."""
        pulse.beat(MAX_BUSY_S)
        await self._in_thread(self._remove_incomplete)
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
        """Finish all captures with the samples received until now, and stop the thread."""
        for unit in list(self._running):
            self._end(unit)
        await self._write()
        self._thread.shutdown(wait=False)

    def _begin(self, unit: str, events: list[AlarmEvent]) -> Capture:
        capture = Capture(
            CaptureFile(self._root, events[0], self._make_writer[unit]),
            min(map(self._settings.start_ns, events)),
            round(self._settings.max_s * self._rate_hz[unit]),
            self._settings,
        )
        self._extend(capture, events)
        for block in self._histories[unit]:
            if block.stop_ns > capture.start_ns:
                capture.add(block)
        self._running[unit] = capture
        return capture

    def _reaches_back(self, capture: Capture, unit: str, events: Sequence[AlarmEvent]) -> bool:
        """Return whether a capture starts early enough for the events, or with the oldest block."""
        oldest_ns = next(iter(self._histories[unit])).start_ns
        return capture.start_ns <= max(min(map(self._settings.start_ns, events)), oldest_ns)

    def _replace(self, unit: str, events: list[AlarmEvent]) -> Capture:
        """Replace the running capture by a capture that starts earlier and has all alarms."""
        before = self._running[unit]
        before.is_replaced, before.pending = True, deque()
        self._end(unit)
        return self._begin(unit, [*before.alarms, *events])

    def _extend(self, capture: Capture, events: Sequence[AlarmEvent]) -> None:
        for event in events:
            capture.extend(event, self._clock.monotonic_s())

    def _end(self, unit: str) -> None:
        self._ended.append(self._running.pop(unit))

    def _end_idle(self) -> None:
        now_s = self._clock.monotonic_s()
        for unit, capture in list(self._running.items()):
            if now_s > capture.deadline_s:
                self._end(unit)

    async def _write(self) -> None:
        for capture in self._all:
            is_last = any(capture is ended for ended in self._ended)
            was_closed = capture.file.is_closed
            await self._in_thread(self._put, capture, is_last)
            if is_last:
                self._ended = [each for each in self._ended if each is not capture]
            if not was_closed and not capture.is_replaced and (is_last or capture.file.is_closed):
                self._listener(Outcome(tuple(capture.alarms), capture.file.finished, self.error))
        self._running = {u: c for u, c in self._running.items() if not c.file.is_closed}

    def _put(self, capture: Capture, is_last: bool) -> None:
        """Write the pending blocks of a capture; runs in the writer thread."""
        try:
            if capture.is_replaced:
                capture.file.abandon("another capture contains the samples")
                return
            pending = capture.pending
            capture.file.write([pending.popleft() for _ in range(len(pending))])
            if is_last and not capture.file.is_closed:
                if capture.is_lost:
                    raise capture.file.abandon("the disk is too slow")
                capture.file.finish(capture.alarms)
                self.n_written += 1
                self._note(None)
        except (CaptureError, OSError) as error:
            self.n_failed += 1
            self._note(str(error))

    def _remove_incomplete(self) -> None:
        try:
            for folder in remove_incomplete(self._root, self._histories):
                log.warning("a capture left incomplete by a crash was removed", folder=folder.name)
        except OSError as error:
            self._note(str(error))
