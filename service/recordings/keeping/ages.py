"""From when on continuous recordings are not too old, by clocks that may be wrong.

The time of a recording is that of its stamps or of when it was found, whichever is later: what a
device records in the year 2000 by its own clock has only just been found. Ages count from a moment
that a day of recordings of the unit lies behind: of a host's clock that is set a year ahead for ten
minutes there are recordings a year ahead, but none of them makes anything old.
"""

from collections import defaultdict
from collections.abc import Iterable

from core.units import NS_PER_S
from service.store.waveform_port import WaveformFile

BELIEVED_NS = 86_400 * NS_PER_S
"""How much has to be recorded by a clock before anything is old by it."""

LONGEST_NS = 3600 * NS_PER_S
"""No recording is longer by the settings: what its stamps say beyond that is a clock that was
set."""


class NotOldFrom:
    """Knows for each unit which of its recordings are too old.

    Parameters
    ----------
    files
        All continuous recordings.
    keep_ns
        For how long they are kept.
    """

    def __init__(self, files: Iterable[WaveformFile], now_ns: int, keep_ns: int) -> None:
        by_unit: defaultdict[str, list[WaveformFile]] = defaultdict(list)
        for file in files:
            by_unit[file.unit].append(file)
        believed = {unit: _believed_ns(of_unit) for unit, of_unit in by_unit.items()}
        self._since_ns = {
            unit: min(now_ns, moment) - keep_ns
            for unit, moment in believed.items()
            if moment is not None
        }
        # whose unit cannot be read was found by the same clock as all others
        self._since_of_others_ns = max(self._since_ns.values(), default=None)

    def is_old(self, file: WaveformFile) -> bool:
        """Whether it has been kept for long enough."""
        since_ns = self._since_ns.get(file.unit)
        if not file.unit:
            since_ns = self._since_of_others_ns
        return since_ns is not None and _time_ns(file) < since_ns


def _believed_ns(files: Iterable[WaveformFile]) -> int | None:
    """The newest time that a day of recordings is newer than; None if there are not so many."""
    n_recorded_ns = 0
    for file in sorted(files, key=_time_ns, reverse=True):
        n_recorded_ns += min(max(file.stop_ns - file.start_ns, 0), LONGEST_NS)
        if n_recorded_ns >= BELIEVED_NS:
            return _time_ns(file)
    return None


def _time_ns(file: WaveformFile) -> int:
    return max(file.stop_ns, file.changed_ns)
