"""Folders in memory, for databases of tests: a real disk takes long to sync."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

MEMORY = Path("/dev/shm")  # noqa: S108
MIN_FREE_BYTES = 10**9


def memory() -> Path | None:
    """File system in memory; None if there is none with enough room."""
    try:
        n_free = shutil.disk_usage(MEMORY).free
    except OSError:
        return None
    return MEMORY if n_free >= MIN_FREE_BYTES and os.access(MEMORY, os.W_OK) else None


@contextmanager
def memory_folder() -> Iterator[Path]:
    """Open a new folder, in memory if possible; it is removed at the end."""
    folder = Path(tempfile.mkdtemp(prefix="padwatch-test-", dir=memory()))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture(name="tmp_path")
def path_in_memory() -> Iterator[Path]:
    """A folder in memory, for folders of tests in which most of the time went into syncs."""
    with memory_folder() as folder:
        yield folder
