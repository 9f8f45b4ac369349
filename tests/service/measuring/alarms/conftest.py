"""What the alarms of a running service stand on in tests: a host's clock, and a failing disk."""

import logging
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import structlog
from rigs.standing_clock import SetClock

from core.machine.channel import Channel, Measurand
from core.machine.unit import Bearing, Unit
from service.store.port import StoreError
from service.store.sqlite import SqliteStore

IDS = ("sx", "sy", "bx", "by")
UNIT = Unit(
    "U1",
    60.0,
    100.0,
    tuple(Channel(id_, Measurand.DISPLACEMENT_UM) for id_ in IDS),
    (Bearing("UJB", 1e9, *IDS, 200.0, (2000.0, 2000.0)),),
)


class UncertainStore:
    """A store that may refuse, wait, or write and not report it."""

    def __init__(self, store: SqliteStore) -> None:
        self._store = store
        self.fate = "writes"
        self.is_asked, self.may_write = threading.Event(), threading.Event()

    def append(self, *found: Any) -> None:
        if self.fate == "refuses":
            raise StoreError("no space left on device")
        if self.fate == "waits":
            self.is_asked.set()
            self.may_write.wait(30)
        self._store.append(*found)
        if self.fate == "writes_silently":
            raise StoreError("the answer got lost")


@pytest.fixture
def host() -> SetClock:
    return SetClock()


@pytest.fixture
def tools() -> SimpleNamespace:
    """Parts of a random life: a store that may fail, a unit."""
    return SimpleNamespace(uncertain=UncertainStore, unit=UNIT)


@pytest.fixture
def _quiet() -> Iterator[None]:
    """Thousands of lives would fill the log."""
    structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(logging.CRITICAL))
    yield
    structlog.reset_defaults()


@pytest.fixture
def database(folder_in_memory: Path) -> Callable[[], Path]:
    """Makes a new, empty database in the place of the one before."""
    empty, path = folder_in_memory / "empty.sqlite3", folder_in_memory / "life.sqlite3"
    SqliteStore(empty).close()

    def make() -> Path:
        for left in folder_in_memory.glob("life.sqlite3*"):
            left.unlink()
        path.write_bytes(empty.read_bytes())
        return path

    return make
