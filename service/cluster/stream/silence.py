"""`Silence`: sees which units nothing comes of, whether the stream was ever reached or not."""

from collections.abc import Collection, Iterable, Mapping

import structlog

from acquisition.clock import Clock
from service.cluster.stream.progress import UnitProgress
from service.live.live_view import LinkState, LiveView
from service.measuring.analysing import Analyser
from service.measuring.link_news import LinkNews
from service.settings.units import UnitSettings

log = structlog.get_logger()

MIN_BLOCKS = 3
"""Blocks that are missing in a row; where a sample is a poll, a block may take a minute."""


def silences_s(units: Iterable[UnitSettings], least_s: float) -> dict[str, float]:
    """How long each unit may be silent: by the settings, and as its blocks come."""
    return {
        unit.id: max(least_s, MIN_BLOCKS * unit.block_samples / unit.sampling_hz) for unit in units
    }


class Silence:
    """Counts units as lost of which nothing has come for a while.

    What was known of a unit may say that samples arrive. While the stream has not been reached
    since the start, there is nobody else who could say otherwise.

    Parameters
    ----------
    after_s
        How long each unit may be silent.
    """

    def __init__(
        self, after_s: Mapping[str, float], analyser: Analyser, live: LiveView, clock: Clock
    ) -> None:
        self._after_s, self._clock = after_s, clock
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
        for unit, after_s in self._after_s.items():
            if unit in waiting:
                continue
            if unit in begun:
                begun[unit].fall_silent(after_s, trouble)
            elif self._clock.monotonic_s() - self._since_s > after_s:
                self._lose(unit, trouble or "the stream has not been reached yet")

    def _lose(self, unit: str, reason: str) -> None:
        if self._live.status(unit).state is LinkState.NOT_CONNECTED:
            return  # it was said
        self._live.set_link(unit, LinkState.NOT_CONNECTED, reason)
        log.warning("not connected", unit=unit, reason=reason)
        self._analyser.hear(LinkNews(unit, LinkState.NOT_CONNECTED, reason))
