"""`DiskSpace`: how much room a disk has, as its file system tells."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class DiskSpace:
    """Room on the disk that a folder is on.

    Parameters
    ----------
    device
        Number of the file system; folders of the same one share its room.
    total_bytes
        What padwatch and all others could have together.
    free_bytes
        What padwatch can still have; what is reserved for root is not in it.
    """

    device: int
    total_bytes: int
    free_bytes: int

    @property
    def free_share(self) -> float:
        """Free part of the whole, 0 to 1."""
        return self.free_bytes / self.total_bytes if self.total_bytes > 0 else 0.0


Measure = Callable[[Path], DiskSpace]


def measure_disk(folder: Path) -> DiskSpace:
    """Ask the file system of a folder; of one that is yet to be made, that of its parent.

    Raises
    ------
    OSError
        If it does not say.
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
