"""Free space of the disks that padwatch writes to: measurement, growth rate, limits, monitor."""

import asyncio
import os
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from acquisition.clock import Clock
from core.limits import WITHIN, AlarmLevel, Judgement, judge, unknown
from core.quality import Reading
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.periodic import periodic
from service.settings.storage import BYTES_PER_GB, SpaceSettings


@dataclass(frozen=True)
class DiskSpace:
    """Capacity and free space of the file system that holds a folder.

    Parameters
    ----------
    device
        Device number of the file system; folders with the same number share its space.
    total_bytes
        Total capacity available to unprivileged users.
    free_bytes
        Free space available to unprivileged users, without the part reserved for root.
    """

    device: int
    total_bytes: int
    free_bytes: int

    @property
    def free_share(self) -> float:
        """Free share of the capacity, 0 to 1."""
        return self.free_bytes / self.total_bytes if self.total_bytes > 0 else 0.0


Measure = Callable[[Path], DiskSpace]


def measure_disk(folder: Path) -> DiskSpace:
    """Return capacity and free space of the file system of a folder, which need not exist.

    The nearest existing parent folder is used. Raises `OSError` if the file system cannot be read.
    """
    there = folder.absolute()
    while not there.exists() and there != there.parent:
        there = there.parent
    found = os.statvfs(there)
    n_taken = found.f_blocks - found.f_bfree
    return DiskSpace(
        device=there.stat().st_dev,
        total_bytes=(n_taken + found.f_bavail) * found.f_frsize,
        free_bytes=found.f_bavail * found.f_frsize,
    )


EVERY_S = 600.0
OVER_S = 86_400.0
"""Minimum interval and time span of the stored measurements. The span is one day, so that the mean
growth includes captures and nightly backups."""

MIN_HISTORY_S = 3600.0
"""Minimum time span of the measurements for an estimate of the growth."""

S_PER_DAY = 86_400.0


class Growth:
    """Estimator of the growth rate of the used space of a disk over the last day."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, int]] = deque()

    def note(self, space: DiskSpace, now_s: float) -> None:
        """Add a measurement at the monotonic time ``now_s``, at most one per `EVERY_S` seconds."""
        if not self._seen or now_s - self._seen[-1][0] >= EVERY_S:
            self._seen.append((now_s, space.free_bytes))
        while len(self._seen) > 2 and now_s - self._seen[1][0] >= OVER_S:
            self._seen.popleft()

    def days_until_full(self, space: DiskSpace, now_s: float) -> float | None:
        """Return the days until the disk is full at the growth rate of the last day.

        Return None if the growth rate is unknown or not positive.
        """
        if not self._seen:
            return None
        since_s, free_then = self._seen[0]
        lasted_s, taken = now_s - since_s, free_then - space.free_bytes
        if lasted_s < MIN_HISTORY_S or taken <= 0:
            return None
        return space.free_bytes / taken * lasted_s / S_PER_DAY


PERIOD_S = 10.0


@dataclass(frozen=True)
class DiskView:
    """Newest measurement of one disk.

    Parameters
    ----------
    name
        Name of the first monitored folder on the disk.
    days_until_full
        Days until the disk is full at the growth rate of the last day; None if the rate is unknown
        or not positive.
    """

    name: str
    space: DiskSpace
    days_until_full: float | None = None

    def __str__(self) -> str:
        space, days = self.space, self.days_until_full
        free_gb, total_gb = (n / BYTES_PER_GB for n in (space.free_bytes, space.total_bytes))
        found = f"{free_gb:.3g} of {total_gb:.3g} GB free"
        return found if days is None else f"{found}, full in {days:.2g} days"


class SpaceWatch:
    """Monitor of the free space of the disks that hold given folders.

    Measurements run in a thread, because a disk may hang.
    """

    def __init__(
        self,
        folders: Mapping[str, Path],
        limits: SpaceSettings,
        clock: Clock,
        measure: Measure = measure_disk,
    ) -> None:
        self._folders, self._limits, self._clock, self._measure = folders, limits, clock, measure
        self._growth: dict[int, Growth] = {}
        self._trouble: str | None = None
        self.disks: tuple[DiskView, ...] = ()
        """Newest measurement of each disk; empty before the first measurement."""

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Measure all disks periodically, until cancelled; `pulse` gets heartbeats."""
        await periodic(self.look, PERIOD_S, self._clock, pulse)

    async def look(self) -> None:
        """Measure all disks once and update `disks`; `disks` is unchanged after a failure."""
        try:
            found = await asyncio.to_thread(self._measured)
        except OSError as error:
            self._trouble = f"the free space of the disk cannot be measured: {error}"
            return
        self._trouble = None
        first: dict[int, DiskView] = {}
        for name, space in zip(self._folders, found, strict=True):
            if space.device not in first:
                first[space.device] = self._seen(name, space)
        self.disks = tuple(first.values())

    def condition(self, held: AlarmLevel | None) -> Judgement:
        """Return the most severe judgement of all disks; unknown if the last measurement failed.

        `held` is the level of the previous judgement; None without an alarm.
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
        limits = self._limits.limits(disk.space.total_bytes)
        found = judge(Reading(disk.space.free_share), limits, held)
        if found.level is None:
            return found
        return Judgement(
            found.level, value=found.value, limit=found.limit, reason=f"{disk.name}: {disk}"
        )


def _urgency(condition: Judgement) -> tuple[int, float]:
    return int(condition.level or 0), -(condition.value or 0.0)
