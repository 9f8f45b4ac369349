"""A store on a real file, and findings to put into it."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from harness.places import Place, SqlitePlace

from core.account import Gap
from service.store.port import TrendQuery, UnitGap
from service.store.sql_store import SqlStore

T0 = 1_767_225_600_000_000_000
HOP_NS = 11_946_666_667


@pytest.fixture
def at() -> Callable[[int], int]:
    """Time of a refresh."""
    return lambda refresh: T0 + refresh * HOP_NS


@pytest.fixture
def gap() -> Callable[..., UnitGap]:
    """Builds recorded gaps."""

    def build(stop_ns: int = T0, unit: str = "U1", first_index: int = 100) -> UnitGap:
        return UnitGap(unit, Gap(3, first_index, 50, stop_ns))

    return build


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


@pytest.fixture
def query() -> Callable[..., TrendQuery]:
    """Builds queries; by default for everything there is about one bearing."""

    def build(*quantities: str, **changes: object) -> TrendQuery:
        arguments: dict[str, object] = {
            "unit": "U1",
            "bearing": "UJB",
            "quantities": quantities or ("speed_rpm",),
            "start_ns": T0 - 10 * HOP_NS,
            "end_ns": T0 + 10_000_000 * HOP_NS,
            "max_points": 5000,
            "hole_ns": 1 << 62,
        }
        return TrendQuery(**{**arguments, **changes})  # type: ignore[arg-type]

    return build
