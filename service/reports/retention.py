"""Retention of bundles: their size on the disk, and removal of the oldest."""

import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from acquisition.clock import Clock
from core.units import DAY_NS
from service.reports.folders import INCOMPLETE, REMOVED, Place, places, removed
from service.runtime.files import sync_folder, write_whole
from service.runtime.times import compact

MAX_REMOVED = 10_000
"""Maximum number of remembered names per unit."""


SURVEY_S = 3600.0
"""Interval after which all folders are surveyed again, as some may have been removed by hand."""


@dataclass(frozen=True)
class EvidenceLimits:
    """Limits of the space for bundles.

    Parameters
    ----------
    max_bytes
        Size above which the oldest bundles are removed that are older than `keep_days`.
    hard_max_bytes
        Size above which the oldest bundles are removed, whatever their age.
    max_per_alarm
        Number per alarm above which its oldest are removed, so that a chattering alarm does not
        displace all others.
    trend_days
        Time before an alarm for which readings of its film are included.
    """

    max_bytes: int = 2_000_000_000
    hard_max_bytes: int = 4_000_000_000
    keep_days: float = 30.0
    max_per_alarm: int = 200
    trend_days: float = 14.0


@dataclass(frozen=True, order=True)
class _Held:
    """Bundle; the name of a folder begins with its time, so that the oldest sort first."""

    name: str
    unit: str


class EvidenceRetention:
    """Removes the oldest bundles; used in the thread that writes them.

    The sizes of all bundles are remembered, so that a flood of alarms does not read all folders.
    """

    def __init__(self, root: Path, limits: EvidenceLimits, clock: Clock) -> None:
        self._root, self._limits, self._clock = root, limits, clock
        self._sizes: dict[str, dict[_Held, int]] = {}
        """Sizes by alarm."""
        self._n_bytes = 0
        self._crowded: set[str] = set()
        """Alarms with too many bundles."""
        self._surveyed_s: float | None = None

    def note(self, place: Place) -> None:
        """Record that a bundle was written, or has grown."""
        own = self._sizes.setdefault(place.alarm, {})
        held, size = _Held(place.folder.name, place.unit), _size(place.folder)
        self._n_bytes += size - own.get(held, 0)
        own[held] = size
        if len(own) > self._limits.max_per_alarm:
            self._crowded.add(place.alarm)

    def make(self) -> list[str]:
        """Remove the oldest bundles until the others fit; the newest always stays.

        Returns
        -------
        list of str
            Names of the removed folders, oldest first.

        Raises
        ------
        OSError
            If the disk refuses; all folders are then surveyed the next time.
        """
        surveyed_s, self._surveyed_s = self._surveyed(), None
        going = self._surplus()
        going |= self._beyond_the_limits(going)
        self._remove(going)
        self._surveyed_s = surveyed_s
        return [held.name for held in sorted(going)]

    def _surveyed(self) -> float:
        """Return the time of the last survey; survey all folders if it is too old."""
        now_s = self._clock.monotonic_s()
        if self._surveyed_s is not None and now_s - self._surveyed_s <= SURVEY_S:
            return self._surveyed_s
        self._sizes, self._n_bytes = {}, 0
        self._crowded.clear()
        for place in places(self._root):
            self.note(place)
        return now_s

    def _surplus(self) -> dict[_Held, str]:
        """Return the surplus bundles of alarms, with their alarms."""
        most = self._limits.max_per_alarm
        return {
            held: alarm for alarm in self._crowded for held in sorted(self._sizes[alarm])[:-most]
        }

    def _beyond_the_limits(self, going: dict[_Held, str]) -> dict[_Held, str]:
        """Return further bundles to remove so that the others fit."""
        n_bytes = self._n_bytes - sum(self._sizes[alarm][held] for held, alarm in going.items())
        if n_bytes <= min(self._limits.max_bytes, self._limits.hard_max_bytes):
            return {}
        all_held = sorted(
            (held, alarm, size) for alarm, own in self._sizes.items() for held, size in own.items()
        )
        young = compact(self._clock.now_ns() - round(self._limits.keep_days * DAY_NS))
        found: dict[_Held, str] = {}
        for held, alarm, size in all_held[:-1]:
            is_young = held.name.partition("-")[0] >= young
            limit = self._limits.hard_max_bytes if is_young else self._limits.max_bytes
            if held not in going and n_bytes > limit:
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
    """Write the names of bundles before they are removed; existing bundles take precedence."""
    all_names = list(dict.fromkeys((*removed(root, unit), *names)))[-MAX_REMOVED:]
    write_whole(root / unit / REMOVED, "".join(f"{name}\n" for name in all_names).encode())


def _remove(folder: Path) -> None:
    aside = folder.with_name(folder.name + INCOMPLETE)
    folder.rename(aside)  # so that no partial bundle has a final name
    shutil.rmtree(aside)


def _size(folder: Path) -> int:
    return sum(file.stat().st_size for file in folder.iterdir())
