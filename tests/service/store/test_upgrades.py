"""Databases of earlier schemas are brought up to date; what is not ours is refused as it is."""

import sqlite3
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import pytest
from harness.places import Place
from rigs.assessments import assessment
from rigs.rolled_trends import gather_all, n_rows
from rigs.store_fixtures import at, query

from core.alarms.alarm import Alarm, AlarmIdentity, AlarmNews, AlarmRule
from core.alarms.life_cycle import update
from core.limits import AlarmLevel, Judgement
from service.settings.storage import Origin
from service.store import schema
from service.store.port import StoreError
from service.store.references import GapReference, ReferenceSource
from service.store.schema import MIGRATIONS
from service.store.sqlite import SqliteStore
from service.store.sqlite.migrating import migrate


@pytest.mark.parametrize("n_before", [2, 3, len(MIGRATIONS) - 1])
def test_an_older_database_keeps_its_data_and_gets_room_for_what_is_new(
    path: Path, monkeypatch: pytest.MonkeyPatch, n_before: int
) -> None:
    path.parent.mkdir()
    with monkeypatch.context() as at_that_time, closing(sqlite3.connect(path)) as old:
        at_that_time.setattr(schema, "MIGRATIONS", MIGRATIONS[:n_before])
        migrate(old, str(path))
        old.execute(
            "INSERT INTO gap (unit, epoch, first_index, n_samples, stop_ns)"
            " VALUES ('U1', 1, 2, 3, 4)"
        )
        old.commit()
    alarm = Alarm(AlarmIdentity("U1", "UJB", "order1_shaft_x"))
    raised = AlarmNews(*update(alarm, Judgement(AlarmLevel.ALERT), 7, AlarmRule()))
    reference = GapReference("U1", "UJB", 5, "A", (1.0, 2.0), None, ReferenceSource.GIVEN)

    with closing(SqliteStore(path)) as store:
        store.append([assessment(speed_rpm=92.3)], [], [raised])
        store.add_reference(reference)

        gather_all(store)
        assert n_rows(path, "rollup_mark") == 1
        assert [gap.first_index for gap in store.gaps("U1", 0, 10)] == [2]
        assert [found.identity for found in store.alarms()] == [alarm.identity]
        assert store.references() == [reference]
        newest = store.newest("U1", "UJB")
    assert newest is not None
    assert newest.readings["speed_rpm"].value == 92.3


BROKEN = "CREATE TABLE more (x TEXT) STRICT; DROP TABLE gap; CREATE TABLE more (x TEXT) STRICT;"


def test_a_migration_that_fails_leaves_the_database_as_it_was(
    store_place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    with closing(store_place.open()) as store:
        store.append([assessment(speed_rpm=92.3)], [])
    with monkeypatch.context() as next_release:
        next_release.setattr(schema, "MIGRATIONS", (*MIGRATIONS, BROKEN))
        with pytest.raises(StoreError, match=r'(table |relation ")more"? already exists'):
            store_place.open()

    with closing(store_place.open()) as store:  # which has a table gap
        assert list(store.trend(query()).series["speed_rpm"].mean) == [92.3]
        assert store.gaps("U1", 0, 10) == []


def test_a_migration_keeps_the_data_and_is_done_once(
    store_place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    with closing(store_place.open()) as store:
        store.append([assessment(speed_rpm=92.3)], [])
    monkeypatch.setattr(schema, "MIGRATIONS", (*MIGRATIONS, "CREATE TABLE more (x TEXT) STRICT;"))

    for _ in range(2):
        with closing(store_place.open()) as store:
            assert list(store.trend(query()).series["speed_rpm"].mean) == [92.3]
    assert store_place.execute("SELECT count(*) FROM more") == [(0,)]


def test_two_commands_that_upgrade_at_the_same_moment_find_the_newest_schema(
    tmp_path: Path,
) -> None:
    for round_ in range(10):
        path = tmp_path / f"{round_}.sqlite3"
        with ThreadPoolExecutor(2) as pool:
            versions = list(pool.map(_upgrade, [path, path]))
        assert versions == [len(MIGRATIONS)] * 2, round_


def _upgrade(path: Path) -> int:
    with closing(sqlite3.connect(path, timeout=5.0, isolation_level=None)) as connection:
        migrate(connection, str(path))
        return int(connection.execute("PRAGMA user_version").fetchone()[0])


@pytest.mark.parametrize(
    "content",
    [
        "CREATE TABLE historian (x); INSERT INTO historian VALUES (1);",
        "CREATE TABLE historian (x); PRAGMA application_id = 1234;",
    ],
)
def test_a_database_of_another_program_is_refused_and_left_as_it_is(
    path: Path, content: str
) -> None:
    path.parent.mkdir()
    with closing(sqlite3.connect(path)) as other:
        other.executescript(content)
    before = path.read_bytes()

    with pytest.raises(StoreError, match="is not a padwatch database"):
        SqliteStore(path)

    assert path.read_bytes() == before


NEWEST = len(MIGRATIONS)
NEWER = {
    "sqlite": f"PRAGMA user_version = {NEWEST + 1}",
    "postgresql": f"UPDATE padwatch SET schema_number = {NEWEST + 1}",  # noqa: S608
}


def test_a_database_of_a_newer_padwatch_is_refused_by_its_schema_number(store_place: Place) -> None:
    store_place.open().close()
    store_place.execute(NEWER[store_place.kind])

    said = f"schema {NEWEST + 1}, this padwatch supports up to {NEWEST}; run the padwatch"
    with pytest.raises(StoreError, match=said):
        store_place.open()


def test_a_truncated_database_and_what_is_none_are_refused(path: Path) -> None:
    store = SqliteStore(path)
    store.append([assessment(at(i), speed_rpm=1.0) for i in range(200)], [])
    store.close()
    whole = path.read_bytes()

    for n_bytes in (len(whole) - 4096, len(whole) // 2, 4096, 100, 50):
        path.write_bytes(whole[:n_bytes])
        with pytest.raises(StoreError, match=f"{path}: "):
            SqliteStore(path)
    path.write_bytes(b"speed;power\n92.3;700\n" * 100)
    with pytest.raises(StoreError, match="file is not a database"):
        SqliteStore(path)


def test_live_and_replayed_results_never_share_a_database(store_place: Place) -> None:
    for _ in range(2):
        store_place.open(Origin.LIVE).close()
    with pytest.raises(StoreError, match="holds live results and cannot be used for replay"):
        store_place.open(Origin.REPLAY)
