"""`SpaceWatch`: looks at the disks for ever, in a thread, since a disk may not answer."""

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from acquisition.clock import Clock
from core.limits import WITHIN, AlarmLevel, Judgement, judge, unknown
from core.quality import Reading
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.space.disk import DiskSpace, Measure, measure_disk
from service.runtime.space.growth import Growth
from service.runtime.space.limits import SpaceLimits

PERIOD_S = 10.0
GB = 1e9


@dataclass(frozen=True)
class DiskView:
    """One disk as it was found last.

    Parameters
    ----------
    name
        Of the first of the folders that are on it.
    days_until_full
        At the pace of the last day; None if that is not known or it does not fill.
    """

    name: str
    space: DiskSpace
    days_until_full: float | None = None

    def __str__(self) -> str:
        space, days = self.space, self.days_until_full
        found = f"{space.free_bytes / GB:.3g} of {space.total_bytes / GB:.3g} GB free"
        return found if days is None else f"{found}, full in {days:.2g} days"


class SpaceWatch:
    """Knows how full the disks of some folders are.

    Parameters
    ----------
    folders
        What padwatch writes to, by name.
    measure
        Asks the file system.
    """

    def __init__(
        self,
        folders: Mapping[str, Path],
        limits: SpaceLimits,
        clock: Clock,
        measure: Measure = measure_disk,
    ) -> None:
        self._folders, self._limits, self._clock, self._measure = folders, limits, clock, measure
        self._growth: dict[int, Growth] = {}
        self._trouble: str | None = None
        self.disks: tuple[DiskView, ...] = ()
        """As they were found last; none before the first look."""

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Look for ever."""
        while True:
            pulse.beat(PERIOD_S)
            await self.look()
            await self._clock.sleep(PERIOD_S)

    async def look(self) -> None:
        """Look once."""
        try:
            found = await asyncio.to_thread(self._measured)
        except OSError as error:
            self._trouble = f"it is not known how full the disk is: {error}"
            return
        self._trouble = None
        first: dict[int, DiskView] = {}
        for name, space in zip(self._folders, found, strict=True):
            if space.device not in first:
                first[space.device] = self._seen(name, space)
        self.disks = tuple(first.values())

    def condition(self, held: AlarmLevel | None) -> Judgement:
        """What is to be said of the fullest disk.

        Parameters
        ----------
        held
            The level of the condition before.
        """
        if self._trouble is not None:
            return unknown(self._trouble)
        found = [(self._judged(disk, held), disk) for disk in self.disks]
        return max((one for one, _ in found), key=_urgency, default=WITHIN)

    def __str__(self) -> str:
        return self._trouble or "; ".join(f"{disk.name}: {disk}" for disk in self.disks)

    def _measured(self) -> list[DiskSpace]:
        return [self._measure(folder) for folder in self._folders.values()]

    def _seen(self, name: str, space: DiskSpace) -> DiskView:
        growth, now_s = self._growth.setdefault(space.device, Growth()), self._clock.monotonic_s()
        growth.note(space, now_s)
        return DiskView(name, space, growth.days_until_full(space, now_s))

    def _judged(self, disk: DiskView, held: AlarmLevel | None) -> Judgement:
        limits = self._limits.of(disk.space.total_bytes)
        found = judge(Reading(disk.space.free_share), limits, held)
        if found.level is None:
            return found
        return Judgement(
            found.level, value=found.value, limit=found.limit, reason=f"{disk.name}: {disk}"
        )


def _urgency(condition: Judgement) -> tuple[int, float]:
    return int(condition.level or 0), -(condition.value or 0.0)
