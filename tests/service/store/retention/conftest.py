"""Stores with a life in them: one that is gathered, one in which all stays single."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from rigs.old_results import Build, life
from rigs.rolled_trends import plain_and_gathered

from service.store.sqlite import SqliteStore


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where the database is."""
    return tmp_path / "old.sqlite3"


@pytest.fixture(scope="session")
def files(assessment: Build) -> dict[str, bytes]:
    """Databases with a life in them, one of them gathered."""
    return plain_and_gathered(life(assessment))


@pytest.fixture
def old(path: Path, files: dict[str, bytes]) -> Iterator[SqliteStore]:
    """A store with a life in it, gathered."""
    path.write_bytes(files["gathered"])
    with closing(SqliteStore(path)) as store:
        yield store


@pytest.fixture
def plain(tmp_path: Path, files: dict[str, bytes]) -> Iterator[SqliteStore]:
    """A store with the same life, of which nothing is ever gathered or deleted."""
    path = tmp_path / "plain.sqlite3"
    path.write_bytes(files["plain"])
    with closing(SqliteStore(path)) as store:
        yield store
