"""A service that starts and stops tells so, and goes on where it cannot."""

import asyncio
import json
from contextlib import closing
from pathlib import Path

import pytest

from acquisition.clock import SystemClock
from service.app.service_audit import ServiceTrail
from service.settings.plant import PlantFile
from service.settings.storage import Origin
from service.store.access.audit_entries import AuditEntry
from service.store.audit import AuditQuery
from service.store.sqlite import SqliteStore


def told(store: SqliteStore) -> list[AuditEntry]:
    return list(reversed(store.audit.entries(AuditQuery())))


async def test_starts_stops_and_a_changed_plant_file_are_told(
    store: SqliteStore, plant: PlantFile
) -> None:
    renamed = plant.plant.model_copy(update={"name": "another name"})
    for found in (plant, plant, plant.model_copy(update={"plant": renamed})):
        trail = ServiceTrail(found, Origin.LIVE, store.audit, SystemClock())
        await trail.begin()
        await trail.end()
    entries = told(store)

    start, stop = "service.started", "service.stopped"
    changed = "configuration.changed"
    assert [e.action for e in entries] == [start, stop, start, stop, changed, start, stop]
    assert {(e.actor, e.source, e.peer) for e in entries} == {("padwatch", "padwatch", None)}
    assert entries[4].before != entries[4].after
    assert entries[4].after is not None
    assert entries[4].after[1:-1] in (entries[5].after or "")


async def test_a_plant_is_watched_also_where_nothing_can_be_told(
    store: SqliteStore, plant: PlantFile, tmp_path: Path
) -> None:
    trail = ServiceTrail(plant, Origin.LIVE, store.audit, SystemClock())
    store.close()
    await trail.begin()
    await trail.end()
    with closing(SqliteStore(tmp_path / "padwatch.sqlite3")) as again:
        assert told(again) == []


class OverError(Exception):
    """Ends a loop that has no end."""


class SetClock:
    """A host whose clock is set while somebody sleeps: by so much each time."""

    def __init__(self, *steps_s: float) -> None:
        self._steps_s, self._steady_s, self._wrong_s = list(steps_s), 0.0, 0.0

    def now_ns(self) -> int:
        return round((1.79e9 + self._steady_s + self._wrong_s) * 1e9)

    def monotonic_s(self) -> float:
        return self._steady_s

    async def sleep(self, duration_s: float) -> None:
        if not self._steps_s:
            raise OverError
        self._steady_s += duration_s
        self._wrong_s += self._steps_s.pop(0)
        await asyncio.sleep(0)


async def test_a_clock_that_is_set_is_told_and_one_that_is_slewed_is_not(
    store: SqliteStore, plant: PlantFile
) -> None:
    clock = SetClock(0.0, 7200.0, 0.01, 0.0, -3600.0, -0.3)
    trail = ServiceTrail(plant, Origin.LIVE, store.audit, clock)
    with pytest.raises(OverError):
        await trail.watch_clock()
    entries = told(store)
    assert {(e.action, e.object, e.actor) for e in entries} == {
        ("clock.stepped", "clock", "padwatch")
    }
    assert [json.loads(e.after or "") for e in entries] == [{"by_s": 7200.0}, {"by_s": -3600.0}]
    assert entries[0].time_ns > entries[1].time_ns
