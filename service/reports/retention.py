"""`EvidenceRetention`: what bundles take of the disk, and which of them go when it is too much."""

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
"""Names that are remembered of each unit."""


SURVEY_S = 3600.0
"""After so long all folders are looked at again: others may have taken some away by hand."""


@dataclass(frozen=True)
class EvidenceLimits:
    """How much space bundles may take.

    Parameters
    ----------
    max_bytes
        Beyond it the oldest go that are older than `keep_days`.
    hard_max_bytes
        Beyond it the oldest go, however young.
    max_per_alarm
        Beyond it the oldest of that alarm go: one that chatters must not push out all others.
    trend_days
        How long before an alarm the readings of its film go with it.
    """

    max_bytes: int = 2_000_000_000
    hard_max_bytes: int = 4_000_000_000
    keep_days: float = 30.0
    max_per_alarm: int = 200
    trend_days: float = 14.0


@dataclass(frozen=True, order=True)
class _Held:
    """A bundle; the name of a folder begins with its moment, so the oldest come first."""

    name: str
    unit: str


class EvidenceRetention:
    """Knows the size of every bundle, so that in a flood of alarms none costs a look at all.

    Lives in the thread that writes.
    """

    def __init__(self, root: Path, limits: EvidenceLimits, clock: Clock) -> None:
        self._root, self._limits, self._clock = root, limits, clock
        self._sizes: dict[str, dict[_Held, int]] = {}
        """By alarm."""
        self._n_bytes = 0
        self._crowded: set[str] = set()
        """Alarms that may have more bundles than they may."""
        self._surveyed_s: float | None = None

    def note(self, place: Place) -> None:
        """Take in that a bundle was written, or has become larger."""
        own = self._sizes.setdefault(place.alarm, {})
        held, size = _Held(place.folder.name, place.unit), _size(place.folder)
        self._n_bytes += size - own.get(held, 0)
        own[held] = size
        if len(own) > self._limits.max_per_alarm:
            self._crowded.add(place.alarm)

    def make(self) -> list[str]:
        """Remove the oldest bundles until all together fit; the newest always stays.

        Returns
        -------
        list of str
            Names of the folders that are gone, oldest first.

        Raises
        ------
        OSError
            If the disk refuses; then all is looked at again the next time.
        """
        surveyed_s, self._surveyed_s = self._surveyed(), None
        going = self._surplus()
        going |= self._beyond_the_limits(going)
        self._remove(going)
        self._surveyed_s = surveyed_s
        return [held.name for held in sorted(going)]

    def _surveyed(self) -> float:
        """When all folders were looked at; now, if that was too long ago."""
        now_s = self._clock.monotonic_s()
        if self._surveyed_s is not None and now_s - self._surveyed_s <= SURVEY_S:
            return self._surveyed_s
        self._sizes, self._n_bytes = {}, 0
        self._crowded.clear()
        for place in places(self._root):
            self.note(place)
        return now_s

    def _surplus(self) -> dict[_Held, str]:
        """What alarms have too many of, and which alarm each belongs to."""
        most = self._limits.max_per_alarm
        return {
            held: alarm for alarm in self._crowded for held in sorted(self._sizes[alarm])[:-most]
        }

    def _beyond_the_limits(self, going: dict[_Held, str]) -> dict[_Held, str]:
        """What must go besides, so that all others fit."""
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
    """Remember what is about to go, once: what is there all the same is found before its name."""
    all_names = list(dict.fromkeys((*removed(root, unit), *names)))[-MAX_REMOVED:]
    write_whole(root / unit / REMOVED, "".join(f"{name}\n" for name in all_names).encode())


def _remove(folder: Path) -> None:
    aside = folder.with_name(folder.name + INCOMPLETE)
    folder.rename(aside)  # never half a bundle under its name
    shutil.rmtree(aside)


def _size(folder: Path) -> int:
    return sum(file.stat().st_size for file in folder.iterdir())
