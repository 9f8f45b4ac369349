"""A clock that stands."""

import asyncio

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
