"""A clock that stands, and one that passes while somebody waits and may be set."""

import asyncio
from typing import TypeVar

T = TypeVar("T")

T0 = 1_767_225_600_000_000_000


class StandingClock:
    """Time passes only when a test says so; who waits gives others their turn."""

    def __init__(self) -> None:
        self.s = 0.0

    def now_ns(self) -> int:
        return T0 + round(self.s * 1e9)

    def monotonic_s(self) -> float:
        return self.s

    async def sleep(self, duration_s: float) -> None:  # noqa: ARG002  time stands still
        await asyncio.sleep(0)


class SetClock(StandingClock):
    """Time passes when a test says so or somebody waits; ``ns`` sets the wall clock alone."""

    def __init__(self) -> None:
        super().__init__()
        self.ns = T0

    def now_ns(self) -> int:
        return self.ns

    async def sleep(self, duration_s: float) -> None:
        self.step(round(duration_s * 1e9))
        await super().sleep(duration_s)

    def step(self, duration_ns: int) -> None:
        """Let time pass by both clocks of the host, as it does where nobody sets one."""
        self.ns += duration_ns
        self.s += duration_ns / 1e9


def at(owner: T, now_ns: int) -> T:
    """Set both clocks of the host for the owner of a clock, which is returned."""
    owner.clock.ns, owner.clock.s = now_ns, (now_ns - T0) / 1e9  # type: ignore[attr-defined]
    return owner
