"""A disk of a few MiB, to be filled and emptied."""

import ctypes
import ctypes.util
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

CHUNK = b"\0" * 65_536


@dataclass(frozen=True)
class SmallDisk:
    """A file system of its own."""

    folder: Path

    @property
    def _ballast(self) -> Path:
        return self.folder / "ballast"

    def fill(self) -> None:
        """Leave nothing to others."""
        handle = os.open(self._ballast, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        try:
            for size in (len(CHUNK), 512):
                while _written(handle, CHUNK[:size]):
                    pass
        finally:
            os.close(handle)

    def free(self) -> None:
        """Give back what was taken."""
        self._ballast.unlink()


@contextmanager
def small_disk(folder: Path, mib: float) -> Iterator[SmallDisk]:
    """Mount one on a folder; skips the test where that is not permitted."""
    folder.mkdir(parents=True, exist_ok=True)
    libc = ctypes.CDLL(ctypes.util.find_library("c"), use_errno=True)
    size = f"size={round(mib * 2**20)}".encode()
    if libc.mount(b"padwatch", os.fsencode(folder), b"tmpfs", 0, size) != 0:
        pytest.skip(f"a disk cannot be mounted here: {os.strerror(ctypes.get_errno())}")
    try:
        yield SmallDisk(folder)
    finally:
        libc.umount2(os.fsencode(folder), 2)  # also if something is still open there


def _written(handle: int, data: bytes) -> bool:
    try:
        return os.write(handle, data) > 0
    except OSError:
        return False
