"""What the alarms of a running service stand on in tests: a host's clock, and a failing disk."""

import logging
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import structlog

from core.alarms.alarm import Alarm
from core.machine import Bearing, Channel, Measurand, Unit
from service.store.port import StoreError
from service.store.sqlite import SqliteStore

SECOND = 1_000_000_000


IDS = ("sx", "sy", "bx", "by")
UNIT = Unit(
    "U1",
    60.0,
    100.0,
    tuple(Channel(id_, Measurand.DISPLACEMENT_UM) for id_ in IDS),
    (Bearing("UJB", 1e9, *IDS, 200.0, (2000.0, 2000.0)),),
)


class Host:
    """Time that only steps forward when asked to, and a wall clock that may be set."""

    def __init__(self) -> None:
        self.ns, self.set_by_s = 1_000 * SECOND, 0.0

    def now_ns(self) -> int:
        return self.ns + round(self.set_by_s * SECOND)

    def monotonic_s(self) -> float:
        return self.ns / SECOND

    async def sleep(self, duration_s: float) -> None:
        self.ns += round(duration_s * SECOND)


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


class Expected:
    """What is to be known of one alarm, by rules of its own."""

    def __init__(self, is_latching: bool) -> None:
        self.is_latching = is_latching
        self.standing = 0  # level of the condition that was known last
        self.level = 0
        self.occurrence = 0
        self.is_seen = True
        self.hidden: dict[str, int | None] = {}

    def finds(self, level: int) -> None:
        was_latched, before = self.level > self.standing, self.standing
        held, self.standing = self.level, level
        if level > before and (was_latched or level > held):
            self.occurrence += 1
            self.is_seen = False
        self.level = max(level, held) if self.is_latching else level

    def hide(self, why: str, until: int | None = None) -> None:
        self.hidden[why] = until

    def show(self, why: str) -> None:
        if why in self.hidden:
            del self.hidden[why]
            self.is_seen = self.is_seen and not self.level

    def restarts(self) -> None:
        self.standing = 0 if self.level > self.standing else self.level

    def copied(self) -> "Expected":
        twin = Expected(self.is_latching)
        twin.__dict__.update(self.__dict__ | {"hidden": dict(self.hidden)})
        return twin

    def agrees_with(self, alarm: Alarm) -> bool:
        hidden = {
            *(["shelf"] if alarm.shelf else []),
            *(["outage"] if alarm.outage else []),
            *(["design"] if alarm.suppressed_by is not None else []),
        }
        return (self.level, self.occurrence, self.is_seen, set(self.hidden)) == (
            *(int(alarm.level or 0), alarm.occurrence, alarm.is_acknowledged, hidden),
        )


@pytest.fixture
def host() -> Host:
    return Host()


@pytest.fixture
def tools() -> SimpleNamespace:
    """Parts of a random life: a store that may fail, a model of an alarm, a unit."""
    return SimpleNamespace(uncertain=UncertainStore, expected=Expected, unit=UNIT)


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
