"""`Silence`: sees which units nothing comes of, whether the stream was ever reached or not."""

from collections.abc import Collection, Iterable, Mapping

import structlog

from acquisition.clock import Clock
from service.live import LinkState, LiveView
from service.roles.analysing import Analyser
from service.roles.link_news import LinkNews
from service.stream.progress import UnitProgress

log = structlog.get_logger()


class Silence:
    """Counts units as lost of which nothing has come for a while.

    What was known of a unit may say that samples arrive. While the stream has not been reached
    since the start, there is nobody else who could say otherwise.

    Parameters
    ----------
    after_s
        How long a unit may be silent.
    """

    def __init__(
        self, units: Iterable[str], after_s: float, analyser: Analyser, live: LiveView, clock: Clock
    ) -> None:
        self._units, self._after_s, self._clock = list(units), after_s, clock
        self._analyser, self._live = analyser, live
        self._since_s = clock.monotonic_s()

    def look(
        self,
        begun: Mapping[str, UnitProgress],
        trouble: str | None,
        waiting: Collection[str] = frozenset(),
    ) -> None:
        """Look at all units once.

        Parameters
        ----------
        begun
            Those whose place on the stream is known.
        trouble
            Why nothing can come, where that is known.
        waiting
            Units of which something has come that was not taken in yet: these are not silent,
            however long the store holds them up.
        """
        for unit in self._units:
            if unit in waiting:
                continue
            if unit in begun:
                begun[unit].fall_silent(self._after_s, trouble)
            elif self._clock.monotonic_s() - self._since_s > self._after_s:
                self._lose(unit, trouble or "the stream has not been reached yet")

    def _lose(self, unit: str, reason: str) -> None:
        if self._live.status(unit).state is LinkState.NOT_CONNECTED:
            return  # it was said
        self._live.set_link(unit, LinkState.NOT_CONNECTED, reason)
        log.warning("not connected", unit=unit, reason=reason)
        self._analyser.hear(LinkNews(unit, LinkState.NOT_CONNECTED, reason))
