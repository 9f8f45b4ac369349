"""Heartbeats of background loops, for the detection of loops that have ended or are stuck."""

import asyncio
import math
from collections.abc import Awaitable, Callable, Mapping

from acquisition.clock import Clock

PATIENCE_S = 60.0
"""Tolerance for a late heartbeat, so that a slow disk is not reported as a stuck loop."""


class Pulse:
    """Receiver of the heartbeats of one loop; this base class ignores all heartbeats."""

    def beat(self, after_s: float = 0.0) -> None:
        """Record a heartbeat; the next one follows within ``after_s`` seconds."""

    def rest(self) -> None:
        """Record a heartbeat of a loop that waits without a time limit."""


UNHEARD = Pulse()
"""Receiver that ignores all heartbeats."""

Loop = Callable[[Pulse], Awaitable[None]]
"""Coroutine function of a loop: runs until cancelled and sends heartbeats to its argument."""


class _LoopPulse(Pulse):
    """Recorder of the heartbeats of one loop, with the due time of the next heartbeat."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._last_s = clock.monotonic_s()
        self._due_s = self._last_s + PATIENCE_S
        self._has_ended = False

    def beat(self, after_s: float = 0.0) -> None:
        """Record a heartbeat; the next one is due within ``after_s`` plus `PATIENCE_S` seconds."""
        self._last_s = self._clock.monotonic_s()
        self._due_s = self._last_s + after_s + PATIENCE_S

    def rest(self) -> None:
        """Record a heartbeat; the next one has no due time."""
        self._last_s, self._due_s = self._clock.monotonic_s(), math.inf

    def end(self) -> None:
        """Record that the loop has ended."""
        self._has_ended = True

    @property
    def trouble(self) -> str | None:
        """Message that the loop has ended or is stuck; None if it runs."""
        if self._has_ended:
            return "has ended"
        now_s = self._clock.monotonic_s()
        if now_s > self._due_s:
            return f"stuck: no heartbeat for {now_s - self._last_s:.0f} s"
        return None


class Heartbeats:
    """Recorder of the heartbeats of all loops that must run as long as the program."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._pulses: dict[str, _LoopPulse] = {}

    async def tend(self, name: str, run: Loop) -> None:
        """Run a loop; record its heartbeats under `name`, and its end if it returns or raises."""
        pulse = self._pulses[name] = _LoopPulse(self._clock)
        try:
            await run(pulse)
        finally:
            pulse.end()

    def start(
        self, loops: Mapping[str, Loop], tasks: asyncio.TaskGroup
    ) -> list[asyncio.Task[None]]:
        """Start each loop as a named task that records its heartbeats; return the tasks."""
        return [tasks.create_task(self.tend(name, loop), name=name) for name, loop in loops.items()]

    def release(self, *names: str) -> None:
        """Remove the loops with these names, which have finished as planned, from the record."""
        for name in names:
            self._pulses.pop(name, None)

    def look(self) -> dict[str, str | None]:
        """Return a message by loop name: that the loop has ended or is stuck, None if it runs."""
        return {name: pulse.trouble for name, pulse in self._pulses.items()}

    @property
    def troubles(self) -> dict[str, str]:
        """Messages that loops have ended or are stuck, by loop name; empty if all loops run."""
        return {name: trouble for name, trouble in self.look().items() if trouble}
