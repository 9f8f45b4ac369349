"""`Track`: what a device said beside its samples, and for which samples that holds."""

from bisect import bisect_right
from collections.abc import Iterator

from acquisition.can.plan import HOLD, MICROSECONDS, SECONDS, Plan
from core.units import NS_PER_S

_MAX_ENTRIES = 4096
_US_PER_S = 1_000_000


class Track:
    """Values of one quantity, each from a sample on; older ones are forgotten."""

    def __init__(self) -> None:
        self.starts: list[int] = []
        self._values: list[float] = []
        self._holds: list[int | None] = []

    def set(self, start: int, value: float, hold: int | None) -> None:
        """Note a value; None as hold if another quantity tells for how many samples it holds."""
        at = bisect_right(self.starts, start)
        if at and self.starts[at - 1] == start:
            at -= 1
            del self.starts[at], self._values[at], self._holds[at]
        self.starts.insert(at, start)
        self._values.insert(at, value)
        self._holds.insert(at, hold)
        if len(self.starts) > _MAX_ENTRIES:
            self.forget(1)

    def entry(self, index: int) -> tuple[int, float, int | None] | None:
        """Start, value and hold of the newest value that is not newer than a sample."""
        at = bisect_right(self.starts, index) - 1
        return None if at < 0 else (self.starts[at], self._values[at], self._holds[at])

    def forget_before(self, index: int) -> None:
        """Forget what was replaced before a sample."""
        self.forget(bisect_right(self.starts, index) - 1)

    def forget(self, n_entries: int) -> None:
        """Forget the oldest."""
        if n_entries > 0:
            del self.starts[:n_entries], self._values[:n_entries], self._holds[:n_entries]


class Tracks:
    """All quantities beside the waveforms of one epoch.

    An old value never passes for a new one: beyond the samples it was said for there is none.
    """

    def __init__(self, plan: Plan, rate_hz: float) -> None:
        self._plan = plan
        self._rate_hz = rate_hz
        self._tracks = {key: Track() for key in plan.quantities}

    def set(self, key: str | int, start: int, value: float, hold: int | None) -> None:
        """Note what a frame said."""
        self._tracks[key].set(start, value, hold)

    def clear(self) -> None:
        """Forget all, as when the device begins to count anew."""
        self._tracks = {key: Track() for key in self._plan.quantities}

    def forget_before(self, index: int) -> None:
        """Forget what no coming sample can need."""
        for track in self._tracks.values():
            track.forget_before(index)

    def at(self, key: str | int, index: int) -> float | None:
        """Value of a quantity at a sample; None if nothing valid was said."""
        entry = self._tracks[key].entry(index) if key in self._tracks else None
        if entry is None:
            return None
        start, value, hold = entry
        return value if index < self._stop(start, hold) else None

    def cuts(self, first: int, stop: int) -> list[int]:
        """Samples between these at which any quantity begins or ends to hold."""
        return sorted({index for index in self._changes(first, stop) if first < index < stop})

    def stamp_ns(self, index: int) -> int | None:
        """Time of a sample by the last stamp before it; None if there is none."""
        if SECONDS not in self._tracks:
            return None
        seconds, microseconds = self._tracks[SECONDS], self._tracks[MICROSECONDS]
        for start in reversed(seconds.starts[: bisect_right(seconds.starts, index)]):
            whole, part = seconds.entry(start), microseconds.entry(start)
            if whole and part and part[0] == start and part[1] < _US_PER_S:
                stamp_ns = (int(whole[1]) * _US_PER_S + int(part[1])) * 1000
                return stamp_ns + round((index - start) * NS_PER_S / self._rate_hz)
        return None

    def _changes(self, first: int, stop: int) -> Iterator[int]:
        for track in self._tracks.values():
            before = max(0, bisect_right(track.starts, first) - 1)
            for start in track.starts[before : bisect_right(track.starts, stop)]:
                entry = track.entry(start)
                yield start
                if entry is not None:
                    yield self._stop(start, entry[2])

    def _stop(self, start: int, hold: int | None) -> int:
        if hold is not None:
            return start + hold
        entry = self._tracks[HOLD].entry(start)
        told = entry is not None and entry[0] == start
        return start + int(entry[1]) if told and entry is not None else start


def ok_flags(bits: float | None, told: bool, n_channels: int) -> tuple[bool, ...]:
    """The device's verdict on each channel; a channel is OK only as long as the device says so."""
    if not told:
        return (True,) * n_channels
    return tuple(bits is not None and bool(int(bits) >> c & 1) for c in range(n_channels))
