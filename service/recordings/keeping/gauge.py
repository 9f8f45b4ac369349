"""`Gauge`: how much room is left for recordings, whatever else can or cannot be done about them."""

from collections.abc import Mapping
from pathlib import Path

from service.recordings.keeping.room import Need
from service.recordings.keeping.troubles import Troubles
from service.runtime.disk import Measure, SpaceLimits
from service.store.waveform_port import WaveformKind


class Gauge:
    """Measures the disks that recordings are on.

    Parameters
    ----------
    roots
        Folder of each kind of recordings.

    Attributes
    ----------
    is_full
        Whether so little room is left on the disk that nothing more is to be recorded.
    need
        What is short on each disk; nothing is removed for the sake of another one.
    """

    def __init__(
        self, roots: Mapping[WaveformKind, Path], space: SpaceLimits, measure: Measure
    ) -> None:
        self._roots, self._space, self._measure = roots, space, measure
        self.is_full = False
        self.need = Need()

    def measure(self) -> None:
        """Measure all of them; one that does not say is short of nothing.

        Raises
        ------
        OSError
            If a disk does not say.
        """
        short = dict.fromkeys(WaveformKind, 0)
        troubles = Troubles()
        for kind, root in self._roots.items():
            with troubles.borne():
                short[kind] = self._short(kind, root)
        self.need = Need(short[WaveformKind.CONTINUOUS], short[WaveformKind.CAPTURE])
        troubles.tell()

    def _short(self, kind: WaveformKind, root: Path) -> int:
        space = self._measure(root)
        limits = self._space.of(space.total_bytes)
        danger = limits.danger_below or 0.0
        least = danger
        if kind is WaveformKind.CONTINUOUS:
            self.is_full = space.free_share < danger
            # more than the alarm needs, so that recordings never raise it
            least = (limits.alert_below or 0.0) + limits.deadband
        return max(round(least * space.total_bytes) - space.free_bytes, 0)
