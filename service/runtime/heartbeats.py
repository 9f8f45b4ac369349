"""Whether every loop of the program is alive: each says by when it will be heard again."""

import math
from collections.abc import Awaitable, Callable
from typing import Protocol, runtime_checkable

from acquisition.clock import Clock

PATIENCE_S = 60.0
"""How much longer than it has said a loop may be silent: a slow disk is no stuck loop."""


class Pulse(Protocol):
    """What a loop tells of itself."""

    def beat(self, after_s: float = 0.0) -> None:
        """Say that it is alive, and what it does next takes no longer than this and `PATIENCE_S`.

        Parameters
        ----------
        after_s
            How long it is going to wait, or what it does may take.
        """
        ...

    def rest(self) -> None:
        """Say that it is alive, and waits for something that may never come."""
        ...


Loop = Callable[[Pulse], Awaitable[None]]
"""Something that runs until it is cancelled, and is heard."""


@runtime_checkable
class Audible(Protocol):
    """Something that can be heard working, while one task works with it."""

    def listen(self, pulse: Pulse) -> None:
        """Let the task that calls this be heard of while it works."""
        ...


class Unheard:
    """The pulse of a loop that nobody listens to."""

    def beat(self, after_s: float = 0.0) -> None:
        """Say nothing."""

    def rest(self) -> None:
        """Say nothing."""


UNHEARD = Unheard()


class HeardPulse:
    """What is known of one loop."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._heard_s = clock.monotonic_s()
        self._due_s = self._heard_s + PATIENCE_S
        self._has_ended = False

    def beat(self, after_s: float = 0.0) -> None:
        """Note a beat."""
        self._heard_s = self._clock.monotonic_s()
        self._due_s = self._heard_s + after_s + PATIENCE_S

    def rest(self) -> None:
        """Note a beat with nothing to do after it."""
        self._heard_s, self._due_s = self._clock.monotonic_s(), math.inf

    def end(self) -> None:
        """Note that the loop is over."""
        self._has_ended = True

    @property
    def trouble(self) -> str | None:
        """What is wrong with the loop; None if nothing is."""
        if self._has_ended:
            return "has ended"
        now_s = self._clock.monotonic_s()
        if now_s > self._due_s:
            return f"stuck: not heard of for {now_s - self._heard_s:.0f} s"
        return None


class Heartbeats:
    """The loops that must run for as long as the program does."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._pulses: dict[str, HeardPulse] = {}

    async def tend(self, name: str, run: Loop) -> None:
        """Run a loop and listen to it; once it has returned, it counts as dead."""
        pulse = self._pulses[name] = HeardPulse(self._clock)
        try:
            await run(pulse)
        finally:
            pulse.end()

    def release(self, *names: str) -> None:
        """Let loops go that have done their work."""
        for name in names:
            self._pulses.pop(name, None)

    def look(self) -> dict[str, str | None]:
        """What is wrong with each loop, by name; None where nothing is."""
        return {name: pulse.trouble for name, pulse in self._pulses.items()}

    @property
    def troubles(self) -> dict[str, str]:
        """What is wrong with those loops that are dead or stuck."""
        return {name: trouble for name, trouble in self.look().items() if trouble}
