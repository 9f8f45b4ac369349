"""The loop that gives memory back to the machine in which nothing is any more."""

import asyncio
import ctypes

from acquisition.clock import Clock
from service.background import rest
from service.heartbeats import UNHEARD, Pulse

PERIOD_S = 60.0
"""Giving back takes a few milliseconds, and what is given is wanted again within the minute."""

TRIM = getattr(ctypes.CDLL(None), "malloc_trim", None)
"""Of the GNU C library; others keep less."""


class SpareMemory:
    """Has the C library return what lies free between what is in use.

    It returns by itself what is free at the end of its heap only. Samples and spectra that come and
    go beside what stays leave holes further down, so that the memory of a process would grow for
    hours although it has no more in use (malloc_trim(3)).
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Give back for ever."""
        while True:
            await asyncio.to_thread(give_back)
            await rest(PERIOD_S, self._clock, pulse)


def give_back() -> None:
    """Return all whole pages to the machine that nothing is in."""
    if TRIM is not None:
        TRIM(0)
