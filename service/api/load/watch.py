"""`LoadWatch`: looks at the queue and at the event loop for ever."""

from collections import Counter, deque

import structlog

from acquisition.clock import Clock
from service.api.load.strain import Load, LoadLimits, Refused, Strain, advance
from service.measuring.acquirer import Bus
from service.runtime.heartbeats import UNHEARD, Pulse

log = structlog.get_logger()

LOOK_EVERY_S = 0.25

N_LOOKS = 4
"""The service is behind when it was at every one of so many looks: one pause is nothing."""


WORDS = {
    Refused.HISTORY: "questions about the past",
    Refused.VIEWS: "questions about the past and views of now",
}


class LoadWatch:
    """Knows what is refused now, and counts it.

    Parameters
    ----------
    bus
        On which blocks wait for their analysis.
    """

    def __init__(self, bus: Bus, limits: LoadLimits, clock: Clock) -> None:
        self._bus, self._limits, self._clock = bus, limits, clock
        self._lags = deque([0.0] * N_LOOKS, N_LOOKS)
        self._overs = deque([0.0] * N_LOOKS, N_LOOKS)
        self._strain = Strain()
        self.n_refused: Counter[Refused] = Counter()

    @property
    def refused(self) -> Refused:
        """Which questions are refused now."""
        return self._strain.refused

    @property
    def words(self) -> str | None:
        """The same in words; None if none are."""
        return WORDS.get(self.refused)

    @property
    def lag_s(self) -> float:
        """By how much the event loop has been late at every look of the last second."""
        return min(self._lags)

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Look for ever."""
        while True:
            pulse.beat(LOOK_EVERY_S)
            due_s = self._clock.monotonic_s() + LOOK_EVERY_S
            await self._clock.sleep(LOOK_EVERY_S)
            self.look(self._clock.monotonic_s() - due_s)

    def look(self, late_s: float) -> None:
        """Look once.

        Parameters
        ----------
        late_s
            By how much the event loop was late.
        """
        self._lags.append(max(0.0, late_s))
        bus = self._bus
        load = Load(bus.oldest_wait_s, bus.depth / bus.capacity, self.lag_s)
        self._overs.append(load.over(self._limits))
        before = self.refused
        self._strain = advance(self._strain, min(self._overs), self._clock.monotonic_s())
        if self.refused != before:
            _log(self.refused, load)

    def refuses(self, question: Refused) -> bool:
        """Whether a question of this kind is refused now; if so, it is counted."""
        if question is Refused.NOTHING or question > self.refused:
            return False
        self.n_refused[question] += 1
        return True


def _log(refused: Refused, load: Load) -> None:
    say = log.warning if refused else log.info
    say(
        "questions are refused" if refused else "questions are answered again",
        refused=refused.name.lower(),
        delay_s=round(load.delay_s, 2),
        waiting_share=round(load.waiting_share, 2),
        lag_s=round(load.lag_s, 2),
    )
