"""Stores with a life in them: one that is gathered, one that is not."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from rigs.rolled_trends import gather_all
from rigs.varied_results import Build, life

from service.store.sqlite import SqliteStore


@pytest.fixture
def plain(tmp_path: Path, assessment: Build) -> Iterator[SqliteStore]:
    """A store with a life in it, of which nothing is gathered."""
    store = SqliteStore(tmp_path / "plain.sqlite3")
    store.append(life(assessment), [])
    yield store
    store.close()


@pytest.fixture
def rolled(tmp_path: Path, assessment: Build) -> Iterator[SqliteStore]:
    """A store with the same life in it, all gathered."""
    store = SqliteStore(tmp_path / "rolled.sqlite3")
    store.append(life(assessment), [])
    gather_all(store)
    yield store
    store.close()


@pytest.fixture
def path_of(tmp_path: Path) -> Callable[[str], Path]:
    """Where a store's file is."""
    return lambda name: tmp_path / f"{name}.sqlite3"
