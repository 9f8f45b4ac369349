"""A database that is not ours, newer, cut or of the other origin is refused and left as it is."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from harness.places import Place
from rigs.assessments import assessment
from rigs.store_fixtures import at

from service.origin import Origin
from service.store.port import StoreError
from service.store.schema import MIGRATIONS
from service.store.sqlite import SqliteStore


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

    said = f"schema {NEWEST + 1}, this padwatch knows up to {NEWEST}; run the padwatch"
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
    with pytest.raises(StoreError, match="holds live results and is not opened for replay"):
        store_place.open(Origin.REPLAY)
