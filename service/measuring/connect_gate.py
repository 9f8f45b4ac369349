"""`ConnectGate`: many lost links, few attempts at a time."""

from acquisition.clock import Clock


class ConnectGate:
    """Lets attempts at a connection through one after the other, evenly spaced.

    Parameters
    ----------
    per_s
        Most attempts in a second, over all links.
    """

    def __init__(self, per_s: float, clock: Clock) -> None:
        self._interval_s = 1.0 / per_s
        self._clock = clock
        self._next_s = clock.monotonic_s()

    async def turn(self) -> None:
        """Wait for one's turn; first come, first served."""
        now_s = self._clock.monotonic_s()
        turn_s = max(self._next_s, now_s)
        self._next_s = turn_s + self._interval_s
        if turn_s > now_s:
            await self._clock.sleep(turn_s - now_s)
