"""A store on a real file."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from harness.places import Place, SqlitePlace

from service.store.sql_store import SqlStore


@pytest.fixture
def tmp_path(folder_in_memory: Path) -> Path:
    """A folder in memory: most of the time went into syncs of the disk."""
    return folder_in_memory


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where the database is."""
    return tmp_path / "data" / "padwatch.sqlite3"


@pytest.fixture
def execute(path: Path) -> Callable[..., list[Any]]:
    """Changes the file behind padwatch's back, which seals nothing."""
    return SqlitePlace(path).execute


@pytest.fixture
def store(store_place: Place) -> Iterator[SqlStore]:
    """An open, empty store."""
    opened = store_place.open()
    yield opened
    opened.close()
