"""The database file: what is foreign, newer or damaged is refused, what was appended is there."""

import sqlite3
import threading
from pathlib import Path

import pytest
from rigs.assessments import assessment
from rigs.rolled_trends import n_rows
from rigs.store_fixtures import Execute, at, gap, query

from service.settings.storage import Origin
from service.store.port import StoreError
from service.store.sqlite import SqliteStore
from service.store.sqlite.migrating import APPLICATION_IDS


def test_every_append_is_written_through_to_the_disk(store: SqliteStore, path: Path) -> None:
    synchronous_full = 2

    assert store._writer.execute("PRAGMA journal_mode").fetchone() == ("wal",)
    assert store._writer.execute("PRAGMA synchronous").fetchone() == (synchronous_full,)
    assert sqlite3.connect(path).execute("PRAGMA application_id").fetchone() == (
        APPLICATION_IDS[Origin.LIVE],
    )


def test_a_batch_is_stored_whole_or_not_at_all(
    store: SqliteStore, path: Path, execute: Execute
) -> None:
    execute("CREATE TRIGGER refuse BEFORE INSERT ON gap BEGIN SELECT RAISE(ABORT, 'no gaps'); END;")

    with pytest.raises(StoreError, match=f"{path}: no gaps"):
        store.append([assessment(at(i), speed_rpm=1.0) for i in range(3)], [gap()])
    assert n_rows(path, "assessment") == n_rows(path, "series") == 0

    execute("DROP TRIGGER refuse")
    store.append([assessment(at(i), speed_rpm=1.0) for i in range(3)], [gap()])
    assert (n_rows(path, "assessment"), n_rows(path, "gap")) == (3, 1)


def test_a_full_disk_is_an_error_and_the_store_recovers_when_there_is_room(
    store: SqliteStore, path: Path
) -> None:
    n_pages = store._writer.execute("PRAGMA page_count").fetchone()[0]
    store._writer.execute(f"PRAGMA max_page_count = {n_pages}")

    for _ in range(2):
        with pytest.raises(StoreError, match="full"):
            store.append([assessment(at(i), speed_rpm=1.0) for i in range(200)], [])
    store._writer.execute("PRAGMA max_page_count = 1000000")
    store.append([assessment(at(i), speed_rpm=1.0) for i in range(200)], [])

    assert n_rows(path, "assessment") == 200


def test_a_commit_that_is_refused_leaves_no_transaction_behind(
    store: SqliteStore, path: Path, execute: Execute
) -> None:
    execute("CREATE TABLE child (x REFERENCES layout (id) DEFERRABLE INITIALLY DEFERRED)")
    execute(
        "CREATE TRIGGER refuse AFTER INSERT ON assessment BEGIN INSERT INTO child VALUES (99); END"
    )
    for _ in range(2):
        with pytest.raises(StoreError, match="FOREIGN KEY"):
            store.append([assessment(speed_rpm=1.0)], [])
    execute("DROP TRIGGER refuse")

    store.append([assessment(speed_rpm=1.0)], [])

    assert n_rows(path, "assessment") == 1


def test_trends_are_read_while_others_are_written(store: SqliteStore) -> None:
    n_batches, per_batch = 20, 20
    lengths: list[int] = []
    first_written = threading.Event()

    def write() -> None:
        for batch in range(n_batches):
            numbers = range(batch * per_batch, (batch + 1) * per_batch)
            store.append([assessment(at(i), speed_rpm=float(i)) for i in numbers], [])
            first_written.set()

    writer = threading.Thread(target=write)
    writer.start()
    first_written.wait(30)
    while writer.is_alive():
        found = store.trend(query("speed_rpm")).series["speed_rpm"].mean
        assert list(found) == [float(i) for i in range(len(found))]
        lengths.append(len(found))
    writer.join()

    assert len(store.trend(query("speed_rpm")).time_ns) == n_batches * per_batch
    assert lengths == sorted(lengths)
    assert all(length % per_batch == 0 for length in lengths)


def test_a_closed_database_is_one_whole_file_also_after_reads(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path / "padwatch.sqlite3")
    assert store.references() == []
    store.close()

    assert [path.name for path in tmp_path.iterdir() if "sqlite3" in path.name] == [
        "padwatch.sqlite3"
    ]
