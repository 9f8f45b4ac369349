"""Thread that listens on a bus, and its bounded queue to the event loop."""

import asyncio
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal

import can

from acquisition.can.bus import foreign_errors_renamed
from acquisition.can.gate import Frame, FrameGate, lost_in_controller, require_bus
from acquisition.can.plan import Refusal, RefusalCounts
from acquisition.can.slcan import SlcanBus
from acquisition.clock import Clock
from acquisition.delivery.arrival import Arrival, InterfaceClock
from acquisition.errors import FrameError, LinkError
from core.samples.blocks import StampFault

_RECEIVE_S = 0.1
_REST_S = 0.005
"""Frames are taken this often; until then they wait in the buffer of the system or the adapter."""

_READS_PER_BATCH = 4
_MAX_BATCH = 2000
_MAX_NONSENSE = 1000
"""Unreadable frames in a row after which the link counts as lost."""

_JOIN_S = 10.0


@dataclass(frozen=True)
class Batch:
    """Frames in the order in which they came.

    Parameters
    ----------
    arrived
        When the last of them had been read; or when it came, by the interface's stamps.
    stamp_fault
        Why a stamp of the interface was not used.
    """

    frames: list[Frame]
    arrived: Arrival
    stamp_fault: StampFault | None = None


class FrameReader:
    """Listens from `start` to `stop`; an error that ends the thread is raised by `next_batch`.

    Parameters
    ----------
    open_bus
        Called in the thread, since it may take seconds.
    where
        Names the bus in errors.
    judges_errors
        Whether this interface's error frames are in the format of Linux.
    refused
        Where frames are counted that are not handed on.
    stamps
        Makes arrivals of the interface's stamps; without, frames arrive when they are read.
    """

    def __init__(
        self,
        open_bus: Callable[[], can.BusABC],
        where: str,
        gate: FrameGate,
        refused: RefusalCounts,
        clock: Clock,
        *,
        max_frames: int,
        when_full: Literal["drop", "wait"],
        judges_errors: bool,
        stamps: InterfaceClock | None = None,
    ) -> None:
        self._open_bus = open_bus
        self._where = where
        self._gate = gate
        self._refused = refused
        self._clock = clock
        self._max_frames = max_frames
        self._waits = when_full == "wait"
        self._judges_errors = judges_errors
        self._stamps = stamps
        self._stamp_fault: StampFault | None = None
        self._batches: deque[Batch] = deque()
        self._n_waiting = 0
        self._room = threading.Condition()
        self._stopping = threading.Event()
        self._news = asyncio.Event()
        self._ended = asyncio.Event()
        self._arrived = Arrival(0, 0.0)
        self._failure: BaseException | None = None
        self._opened: asyncio.Future[None]
        self._thread: threading.Thread
        self._loop: asyncio.AbstractEventLoop

    async def start(self) -> None:
        """Open the bus.

        Raises
        ------
        LinkError, ConfigError
            As opening it does.
        """
        self._loop = asyncio.get_running_loop()
        self._opened = self._loop.create_future()
        self._thread = threading.Thread(target=self._run, name=f"can {self._where}", daemon=True)
        self._thread.start()
        await asyncio.shield(self._opened)

    async def stop(self) -> None:
        """Close the bus and wait for the thread to end.

        A driver that hangs cannot be ended: its thread then dies with the process.
        """
        self._stopping.set()
        with self._room:
            self._room.notify_all()
        try:
            async with asyncio.timeout(_JOIN_S):
                await self._ended.wait()
        except TimeoutError:
            return
        finally:
            self._thread.join(_RECEIVE_S)
            if self._opened.done():
                self._opened.exception()  # else asyncio logs it as never retrieved

    async def next_batch(self, timeout_s: float) -> Batch | None:
        """Return the next frames, or None if there are none in time.

        Raises
        ------
        LinkError
            If the bus is lost.
        """
        if not self._batches and self._failure is None:
            self._news.clear()
            try:
                async with asyncio.timeout(timeout_s):
                    await self._news.wait()
            except TimeoutError:
                return None
        if self._batches:
            with self._room:
                batch = self._batches.popleft()
                self._n_waiting -= len(batch.frames)
                self._room.notify_all()
            return batch
        if self._failure is not None:
            raise self._failure
        return None

    def _run(self) -> None:
        try:
            with foreign_errors_renamed(self._where):
                bus = self._open_bus()
                try:
                    self._call(self._set_opened)
                    self._listen(bus)
                finally:
                    bus.shutdown()
        except BaseException as exc:
            self._failure = exc
        finally:
            self._call(self._set_ended)

    def _listen(self, bus: can.BusABC) -> None:
        while not self._stopping.is_set():
            frames: list[Frame] = []
            try:
                self._collect(bus, frames)
            finally:  # what came before the bus failed is good
                if isinstance(bus, SlcanBus):
                    self._refused[Refusal.MALFORMED] += bus.take_n_malformed()
                if frames:
                    self._hand_over(Batch(frames, self._arrived, self._stamp_fault))
                    self._stamp_fault = None
            if not frames and bus.state is can.BusState.ERROR:
                raise LinkError(f"{self._where}: the interface reports that it is in error")

    def _collect(self, bus: can.BusABC, frames: list[Frame]) -> None:
        """Wait for a frame, then go on for a while, since a batch costs more than its frames."""
        self._receive(bus, frames, _RECEIVE_S)
        for _ in range(_READS_PER_BATCH - 1):
            if not frames or len(frames) >= _MAX_BATCH or self._stopping.wait(_REST_S):
                return
            self._receive(bus, frames, 0.0)

    def _receive(self, bus: can.BusABC, frames: list[Frame], timeout_s: float) -> None:
        """Take all frames that have come, after waiting for the first."""
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
                self._note_arrival(stamp_s)

    def _note_arrival(self, stamp_s: float) -> None:
        self._arrived = Arrival.now(self._clock)
        if self._stamps is not None:
            self._arrived, fault = self._stamps.arrival(stamp_s, self._arrived)
            self._stamp_fault = self._stamp_fault or fault

    def _next_message(self, bus: can.BusABC, timeout_s: float) -> can.Message | None:
        """Next readable message; a bus that delivers no others for long is lost."""
        for _ in range(_MAX_NONSENSE):
            try:
                with foreign_errors_renamed(self._where):
                    message = bus.recv(timeout_s)
            except FrameError:
                self._refused[Refusal.MALFORMED] += 1
                continue
            if message is not None and message.is_error_frame and self._judges_errors:
                require_bus(message)
                self._refused[Refusal.OVERFLOW] += lost_in_controller(message)
            return message
        raise LinkError(f"{self._where}: {_MAX_NONSENSE} messages in a row that cannot be read")

    def _hand_over(self, batch: Batch) -> None:
        n_frames = len(batch.frames)
        with self._room:
            if self._waits:
                self._room.wait_for(lambda: self._has_room(n_frames) or self._stopping.is_set())
            if not self._has_room(n_frames):
                self._refused[Refusal.OVERFLOW] += n_frames
                return
            self._batches.append(batch)
            self._n_waiting += n_frames
        self._call(self._news.set)

    def _has_room(self, n_frames: int) -> bool:
        return not self._batches or self._n_waiting + n_frames <= self._max_frames

    def _set_opened(self) -> None:
        if not self._opened.done():
            self._opened.set_result(None)

    def _set_ended(self) -> None:
        if not self._opened.done():
            failure = self._failure or LinkError(f"{self._where}: closed before it was open")
            self._opened.set_exception(failure)
        self._news.set()
        self._ended.set()

    def _call(self, function: Callable[[], None]) -> None:
        """Call a function in the event loop."""
        with suppress(RuntimeError):  # the loop has ended while a driver was hanging
            self._loop.call_soon_threadsafe(function)
