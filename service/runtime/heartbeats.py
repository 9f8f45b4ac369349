"""Heartbeats: liveness of every loop of the program; each announces its next beat."""

import math
from collections.abc import Awaitable, Callable

from acquisition.clock import Clock

PATIENCE_S = 60.0
"""Tolerance for a late beat: a slow disk does not make a loop stuck."""


class Pulse:
    """Receiver of the heartbeats of one loop; this base class ignores them."""

    def beat(self, after_s: float = 0.0) -> None:
        """Report that the loop is alive, and the longest time until its next beat."""

    def rest(self) -> None:
        """Report that the loop is alive and waits without limit."""


UNHEARD = Pulse()
"""Receiver that ignores all heartbeats."""

Loop = Callable[[Pulse], Awaitable[None]]
"""A coroutine function that runs until it is cancelled and sends heartbeats."""


class LoopPulse(Pulse):
    """Last beat of one loop, and the time when the next is due."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._last_s = clock.monotonic_s()
        self._due_s = self._last_s + PATIENCE_S
        self._has_ended = False

    def beat(self, after_s: float = 0.0) -> None:
        """Record a beat; the next is due after ``after_s`` and `PATIENCE_S`."""
        self._last_s = self._clock.monotonic_s()
        self._due_s = self._last_s + after_s + PATIENCE_S

    def rest(self) -> None:
        """Record a beat after which none is due."""
        self._last_s, self._due_s = self._clock.monotonic_s(), math.inf

    def end(self) -> None:
        """Record that the loop has ended."""
        self._has_ended = True

    @property
    def trouble(self) -> str | None:
        """Why the loop is not alive; None if it is."""
        if self._has_ended:
            return "has ended"
        now_s = self._clock.monotonic_s()
        if now_s > self._due_s:
            return f"stuck: no heartbeat for {now_s - self._last_s:.0f} s"
        return None


class Heartbeats:
    """Liveness of the loops that must run as long as the program."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._pulses: dict[str, LoopPulse] = {}

    async def tend(self, name: str, run: Loop) -> None:
        """Run a loop and record its heartbeats; a loop that returns counts as dead."""
        pulse = self._pulses[name] = LoopPulse(self._clock)
        try:
            await run(pulse)
        finally:
            pulse.end()

    def release(self, *names: str) -> None:
        """Remove loops that have finished as planned."""
        for name in names:
            self._pulses.pop(name, None)

    def look(self) -> dict[str, str | None]:
        """Return the fault of each loop by name, None where a loop is alive."""
        return {name: pulse.trouble for name, pulse in self._pulses.items()}

    @property
    def troubles(self) -> dict[str, str]:
        """Faults of the loops that are dead or stuck, by name."""
        return {name: trouble for name, trouble in self.look().items() if trouble}
