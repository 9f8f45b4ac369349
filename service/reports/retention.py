"""Retention of evidence bundles: limits of their size and number, removal of the oldest."""

import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from acquisition.clock import Clock
from core.units import DAY_NS
from service.reports.folders import INCOMPLETE, REMOVED, Place, places, removed
from service.runtime.files import sync_folder, write_whole
from service.runtime.times import compact
from service.settings.storage import BYTES_PER_GB, EvidenceSettings

MAX_REMOVED = 10_000
"""Maximum number of names of removed bundles per unit that are kept."""


SURVEY_S = 3600.0
"""Interval in seconds between surveys of all folders; folders may be removed by hand."""


@dataclass(frozen=True, order=True)
class _Held:
    """Bundle on the disk; sorts by age, since the folder name begins with the time."""

    name: str
    unit: str


class EvidenceRetention:
    """Retention of evidence bundles; for use in the thread that writes them.

    The sizes of all bundles are cached, so that an alarm flood does not read all folders.
    """

    def __init__(self, root: Path, limits: EvidenceSettings, clock: Clock) -> None:
        self._root, self._limits, self._clock = root, limits, clock
        self._sizes: dict[str, dict[_Held, int]] = {}
        """Sizes of bundles in bytes, by alarm."""
        self._n_bytes = 0
        self._crowded: set[str] = set()
        """Alarms with more bundles than `max_per_alarm`."""
        self._surveyed_s: float | None = None

    def note(self, place: Place) -> None:
        """Update the cached size of a bundle after it was written or a file was added to it.

        Raises `OSError` if the folder cannot be read.
        """
        own = self._sizes.setdefault(place.alarm, {})
        held = _Held(place.folder.name, place.unit)
        size = sum(file.stat().st_size for file in place.folder.iterdir())
        self._n_bytes += size - own.get(held, 0)
        own[held] = size
        if len(own) > self._limits.max_per_alarm:
            self._crowded.add(place.alarm)

    def make(self) -> list[str]:
        """Remove the oldest bundles until the remaining bundles meet the limits.

        The newest bundle is always kept. Returns the names of the removed folders, oldest first.
        Raises `OSError` if a folder cannot be read or removed; the next call surveys all folders.
        """
        surveyed_s, self._surveyed_s = self._surveyed(), None
        most = self._limits.max_per_alarm
        going = {
            held: alarm for alarm in self._crowded for held in sorted(self._sizes[alarm])[:-most]
        }
        going |= self._beyond_the_limits(going)
        self._remove(going)
        self._surveyed_s = surveyed_s
        return [held.name for held in sorted(going)]

    def _surveyed(self) -> float:
        """Survey all folders if the last survey is too old; return the time of the last survey."""
        now_s = self._clock.monotonic_s()
        if self._surveyed_s is not None and now_s - self._surveyed_s <= SURVEY_S:
            return self._surveyed_s
        self._sizes, self._n_bytes = {}, 0
        self._crowded.clear()
        for place in places(self._root):
            self.note(place)
        return now_s

    def _beyond_the_limits(self, going: dict[_Held, str]) -> dict[_Held, str]:
        """Return further bundles to remove because of their total size, with their alarms."""
        n_bytes = self._n_bytes - sum(self._sizes[alarm][held] for held, alarm in going.items())
        limits = self._limits
        soft, hard = (round(gb * BYTES_PER_GB) for gb in (limits.max_gb, limits.hard_max_gb))
        if n_bytes <= soft:
            return {}
        all_held = sorted(
            (held, alarm, size) for alarm, own in self._sizes.items() for held, size in own.items()
        )
        young = compact(self._clock.now_ns() - round(self._limits.keep_days * DAY_NS))
        found: dict[_Held, str] = {}
        for held, alarm, size in all_held[:-1]:
            is_young = held.name.partition("-")[0] >= young
            if held not in going and n_bytes > (hard if is_young else soft):
                found[held] = alarm
                n_bytes -= size
        return found

    def _remove(self, going: dict[_Held, str]) -> None:
        for unit in sorted({held.unit for held in going}):
            own = sorted(held for held in going if held.unit == unit)
            _remember(self._root, unit, (held.name for held in own))
            for held in own:
                _remove(self._root / unit / held.name)
                self._n_bytes -= self._sizes[going[held]].pop(held)
            sync_folder(self._root / unit)
        self._crowded.clear()


def _remember(root: Path, unit: str, names: Iterable[str]) -> None:
    """Add names to the list of removed bundles before removal; a bundle that exists is not lost."""
    all_names = list(dict.fromkeys((*removed(root, unit), *names)))[-MAX_REMOVED:]
    write_whole(root / unit / REMOVED, "".join(f"{name}\n" for name in all_names).encode())


def _remove(folder: Path) -> None:
    aside = folder.with_name(folder.name + INCOMPLETE)
    folder.rename(aside)  # no partial bundle may have a final name
    shutil.rmtree(aside)
