"""A store on a real file."""

from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from harness.places import Place, SqlitePlace
from rigs.memory_folder import path_in_memory  # noqa: F401 - a fixture

from service.store.sqlite import SqliteStore
from service.store.store import Store


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where the database is."""
    return tmp_path / "data" / "padwatch.sqlite3"


@pytest.fixture
def execute(path: Path) -> Callable[..., list[Any]]:
    """Changes the file behind padwatch's back, which seals nothing."""
    return SqlitePlace(path).execute


@pytest.fixture
def store(store_place: Place) -> Iterator[Store]:
    """An open, empty store."""
    opened = store_place.open()
    yield opened
    opened.close()


def open_copy(path: Path, content: bytes) -> Iterator[SqliteStore]:
    """Open a store on a copy of a file, as fixtures do."""
    path.write_bytes(content)
    with closing(SqliteStore(path)) as opened:
        yield opened


@pytest.fixture
def plain(tmp_path: Path, files: dict[str, bytes]) -> Iterator[SqliteStore]:
    """A store with a life in it, of which nothing is gathered or deleted."""
    yield from open_copy(tmp_path / "plain.sqlite3", files["plain"])


@pytest.fixture
def rolled(tmp_path: Path, files: dict[str, bytes]) -> Iterator[SqliteStore]:
    """A store with the same life in it, all gathered."""
    yield from open_copy(tmp_path / "rolled.sqlite3", files["gathered"])
