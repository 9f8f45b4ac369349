"""Files that are on the disk, not only on their way there."""

import os
from pathlib import Path

PRIVATE = 0o600


def create_private(path: Path) -> None:
    """Make an empty file that only its owner may read: what is copied holds accounts."""
    os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, PRIVATE))


def put_in_place(aside: Path, path: Path) -> None:
    """Give a finished file its name, in one step, and have both on the disk."""
    _sync(aside)
    aside.replace(path)
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Have the names in a folder on the disk."""
    _sync(folder)


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
