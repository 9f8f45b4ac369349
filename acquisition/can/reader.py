"""Reader thread of a CAN bus, with a bounded queue to the event loop."""

import asyncio
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import can

from acquisition.can.bus import LINUX_ERROR_FRAMES, foreign_errors_renamed
from acquisition.can.gate import Frame, FrameGate, lost_in_controller, require_bus
from acquisition.can.plan import Plan, Refusal, RefusalCounts
from acquisition.can.settings import CanSettings
from acquisition.clock import Clock
from acquisition.delivery.arrival import Arrival, InterfaceClock
from acquisition.errors import FrameError, LinkError
from core.samples.blocks import StampFault

_RECEIVE_S = 0.1
_REST_S = 0.005
"""Delay between reads; meanwhile the system or the interface buffers the frames."""

_READS_PER_BATCH = 4
_MAX_BATCH = 2000
_MAX_NONSENSE = 1000
"""Successive unreadable frames after which the link counts as lost."""

_JOIN_S = 10.0


@dataclass(frozen=True)
class Batch:
    """Frames that were read together.

    Parameters
    ----------
    frames
        Frames in order of arrival; at least one.
    arrived
        Time when the last frame was read, or its arrival time by the interface's time stamps.
    stamp_fault
        Reason why a time stamp of the interface was not used; None without a fault.
    """

    frames: list[Frame]
    arrived: Arrival
    stamp_fault: StampFault | None = None


class FrameReader:
    """Thread that reads the frames of a bus, from `start` to `stop`.

    If an error ends the thread, `next_batch` raises the error.

    Parameters
    ----------
    open_bus
        Function that opens the bus; called in the thread, because it may take seconds.
    refused
        Counts of refused frames; updated in place.
    """

    def __init__(
        self,
        settings: CanSettings,
        open_bus: Callable[[], can.BusABC],
        plan: Plan,
        refused: RefusalCounts,
        clock: Clock,
    ) -> None:
        self._settings, self._where = settings, str(settings.link)
        self._open_bus = open_bus
        self._gate, self._refused = FrameGate(plan, refused), refused
        self._clock = clock
        self._stamps = InterfaceClock() if settings.stamps == "interface" else None
        self._stamp_fault: StampFault | None = None
        self._arrived = Arrival(0, 0.0)
        self._batches: deque[Batch] = deque()
        self._n_waiting = 0
        self._room = threading.Condition()
        self._is_open = self._has_ended = self._is_stopping = False
        self._failure: BaseException | None = None
        self._news = asyncio.Event()
        self._loop: asyncio.AbstractEventLoop

    async def start(self) -> None:
        """Start the thread and wait until the bus is open.

        Raises LinkError or ConfigError if `open_bus` fails.
        """
        self._loop = asyncio.get_running_loop()
        self._thread = threading.Thread(target=self._run, name=f"can {self._where}", daemon=True)
        self._thread.start()
        await self._until(lambda: self._is_open or self._has_ended)
        if self._failure is not None and not self._is_open:
            raise self._failure

    async def stop(self) -> None:
        """Close the bus and wait for the thread to end.

        Returns after at most 10 s: a thread blocked in a driver ends only with the process.
        """
        with self._room:
            self._is_stopping = True
            self._room.notify_all()
        try:
            async with asyncio.timeout(_JOIN_S):
                await self._until(lambda: self._has_ended)
        except TimeoutError:
            return
        finally:
            self._thread.join(_RECEIVE_S)

    async def next_batch(self, timeout_s: float) -> Batch | None:
        """Return the next batch of frames; None if no frames arrive before the timeout.

        Raises LinkError if the bus is lost. Any other error that ended the thread is raised again.
        """
        with suppress(TimeoutError):
            async with asyncio.timeout(timeout_s):
                await self._until(lambda: bool(self._batches) or self._has_ended)
        if self._batches:
            with self._room:
                batch = self._batches.popleft()
                self._n_waiting -= len(batch.frames)
                self._room.notify_all()
            return batch
        if self._failure is not None:
            raise self._failure
        return None

    async def _until(self, is_so: Callable[[], bool]) -> None:
        """Wait until a condition that the reader thread changes is true."""
        while not is_so():
            self._news.clear()
            await self._news.wait()

    def _run(self) -> None:
        try:
            with foreign_errors_renamed(self._where):
                bus = self._open_bus()
                try:
                    self._is_open = True
                    self._announce()
                    while not self._is_stopping:
                        self._listen(bus)
                finally:
                    bus.shutdown()
        except BaseException as exc:
            self._failure = exc
        finally:
            self._has_ended = True
            self._announce()

    def _announce(self) -> None:
        with suppress(RuntimeError):  # the loop ended while the thread was blocked in a driver
            self._loop.call_soon_threadsafe(self._news.set)

    def _listen(self, bus: can.BusABC) -> None:
        """Wait for a frame, then read several times into one batch to save overhead per batch."""
        frames: list[Frame] = []
        try:
            self._receive(bus, frames, _RECEIVE_S)
            for _ in range(_READS_PER_BATCH - 1):
                if not frames or len(frames) >= _MAX_BATCH or self._is_stopping:
                    break
                time.sleep(_REST_S)
                self._receive(bus, frames, 0.0)
        finally:  # frames received before the failure are valid
            if frames:
                self._hand_over(Batch(frames, self._arrived, self._stamp_fault))
                self._stamp_fault = None
        if not frames and bus.state is can.BusState.ERROR:
            raise LinkError(f"{self._where}: the CAN interface is in an error state; check wiring")

    def _receive(self, bus: can.BusABC, frames: list[Frame], timeout_s: float) -> None:
        """Append the received frames to `frames`; wait at most `timeout_s` for the first frame."""
        n_before, stamp_s = len(frames), 0.0
        try:
            while len(frames) < _MAX_BATCH:
                message = self._next_message(bus, timeout_s)
                if message is None:
                    break
                timeout_s = 0.0
                frame = self._gate.admit(message)
                if frame is not None:
                    frames.append(frame)
                    stamp_s = message.timestamp
        finally:
            if len(frames) > n_before:
                self._arrived = Arrival.now(self._clock)
                if self._stamps is not None:
                    self._arrived, fault = self._stamps.arrival(stamp_s, self._arrived)
                    self._stamp_fault = self._stamp_fault or fault

    def _next_message(self, bus: can.BusABC, timeout_s: float) -> can.Message | None:
        """Return the next message, or None at the timeout; malformed messages are skipped.

        Raises LinkError after too many successive malformed messages, and for a faulty bus.
        """
        judges_errors = self._settings.link.interface in LINUX_ERROR_FRAMES
        for _ in range(_MAX_NONSENSE):
            try:
                with foreign_errors_renamed(self._where):
                    message = bus.recv(timeout_s)
            except FrameError:
                self._refused[Refusal.MALFORMED] += 1
                continue
            if message is not None and message.is_error_frame and judges_errors:
                require_bus(message, self._where)
                self._refused[Refusal.OVERFLOW] += lost_in_controller(message)
            return message
        words = f"{_MAX_NONSENSE} malformed messages in succession; check the adapter"
        raise LinkError(f"{self._where}: {words}")

    def _hand_over(self, batch: Batch) -> None:
        n_frames = len(batch.frames)

        def has_room() -> bool:
            return not self._batches or self._n_waiting + n_frames <= self._settings.queue_frames

        with self._room:
            if self._settings.when_full == "wait":
                self._room.wait_for(lambda: has_room() or self._is_stopping)
            if not has_room():
                self._refused[Refusal.OVERFLOW] += n_frames
                return
            self._batches.append(batch)
            self._n_waiting += n_frames
        self._announce()
