"""A service that starts and stops tells so, and goes on where it cannot."""

from pathlib import Path

from acquisition.clock import SystemClock
from service.audit.entry import AuditEntry
from service.origin import Origin
from service.settings.loading import load_plant_file
from service.store.audit_port import AuditQuery
from service.store.sqlite import SqliteStore
from service.wiring.audit import ServiceTrail


def told(store: SqliteStore) -> list[AuditEntry]:
    return list(reversed(store.audit.entries(AuditQuery())))


async def test_starts_stops_and_a_changed_plant_file_are_told(tmp_path: Path, deploy: Path) -> None:
    store = SqliteStore(tmp_path / "padwatch.sqlite3")
    plant = load_plant_file(deploy / "demo.toml")
    renamed = plant.plant.model_copy(update={"name": "another name"})
    for found in (plant, plant, plant.model_copy(update={"plant": renamed})):
        trail = ServiceTrail(found, Origin.LIVE, store.audit, SystemClock())
        await trail.begin()
        await trail.end()
    entries = told(store)
    store.close()

    start, stop = "service.started", "service.stopped"
    changed = "configuration.changed"
    assert [e.action for e in entries] == [start, stop, start, stop, changed, start, stop]
    assert {(e.actor, e.source, e.peer) for e in entries} == {("padwatch", "padwatch", None)}
    assert entries[4].before != entries[4].after
    assert entries[4].after is not None
    assert entries[4].after[1:-1] in (entries[5].after or "")


async def test_a_plant_is_watched_also_where_nothing_can_be_told(
    tmp_path: Path, deploy: Path
) -> None:
    path = tmp_path / "padwatch.sqlite3"
    store = SqliteStore(path)
    plant = load_plant_file(deploy / "demo.toml")
    trail = ServiceTrail(plant, Origin.LIVE, store.audit, SystemClock())
    store.close()
    await trail.begin()
    await trail.end()
    again = SqliteStore(path)
    assert told(again) == []
    again.close()
