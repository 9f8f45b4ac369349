"""Stores with a life in them: one that is gathered, one that is not."""

from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest
from rigs.rolled_trends import plain_and_gathered
from rigs.store_fixtures import Build
from rigs.varied_results import life

from core.assessment import Assessment
from service.store.sqlite import SqliteStore


@pytest.fixture(scope="session")
def results(assessment: Build) -> list[Assessment]:
    """Results of four hours."""
    return life(assessment)


@pytest.fixture(scope="session")
def files(results: list[Assessment]) -> dict[str, bytes]:
    """Databases that hold them, one of them gathered."""
    return plain_and_gathered(results)


@pytest.fixture
def path_of(tmp_path: Path) -> Callable[[str], Path]:
    """Where a store's file is."""
    return lambda name: tmp_path / f"{name}.sqlite3"


@pytest.fixture
def plain(path_of: Callable[[str], Path], files: dict[str, bytes]) -> Iterator[SqliteStore]:
    """A store with a life in it, of which nothing is gathered."""
    path_of("plain").write_bytes(files["plain"])
    with closing(SqliteStore(path_of("plain"))) as store:
        yield store


@pytest.fixture
def rolled(path_of: Callable[[str], Path], files: dict[str, bytes]) -> Iterator[SqliteStore]:
    """A store with the same life in it, all gathered."""
    path_of("rolled").write_bytes(files["gathered"])
    with closing(SqliteStore(path_of("rolled"))) as store:
        yield store
