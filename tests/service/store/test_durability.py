"""The database file: what was appended is there, older ones are upgraded, others refused."""

import os
import shutil
import sqlite3
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from rigs.assessments import assessment
from rigs.rolled_trends import gather_all, n_rows
from rigs.store_fixtures import at, gap, query
from typer.testing import CliRunner

from core.alarms.alarm import Alarm, AlarmIdentity, AlarmNews, AlarmRule
from core.alarms.life_cycle import update
from core.limits import AlarmLevel, Judgement
from service.cli import processes  # noqa: F401  nobody may not read the modules of root's Python
from service.cli.commands import app
from service.settings.storage import Origin
from service.store import schema
from service.store.port import StoreError
from service.store.references import GapReference, ReferenceSource
from service.store.schema import MIGRATIONS
from service.store.sqlite import SqliteStore
from service.store.sqlite.migrating import APPLICATION_IDS, migrate


def test_every_append_is_written_through_to_the_disk(store, path):
    synchronous_full = 2

    assert store._writer.execute("PRAGMA journal_mode").fetchone() == ("wal",)
    assert store._writer.execute("PRAGMA synchronous").fetchone() == (synchronous_full,)
    assert sqlite3.connect(path).execute("PRAGMA application_id").fetchone() == (
        APPLICATION_IDS[Origin.LIVE],
    )


def test_a_batch_is_stored_whole_or_not_at_all(store, path, execute):
    execute("CREATE TRIGGER refuse BEFORE INSERT ON gap BEGIN SELECT RAISE(ABORT, 'no gaps'); END;")

    with pytest.raises(StoreError, match=f"{path}: no gaps"):
        store.append([assessment(at(i), speed_rpm=1.0) for i in range(3)], [gap()])
    assert n_rows(path, "assessment") == n_rows(path, "series") == 0

    execute("DROP TRIGGER refuse")
    store.append([assessment(at(i), speed_rpm=1.0) for i in range(3)], [gap()])
    assert (n_rows(path, "assessment"), n_rows(path, "gap")) == (3, 1)


def test_a_full_disk_is_an_error_and_the_store_recovers_when_there_is_room(store, path):
    n_pages = store._writer.execute("PRAGMA page_count").fetchone()[0]
    store._writer.execute(f"PRAGMA max_page_count = {n_pages}")

    for _ in range(2):
        with pytest.raises(StoreError, match="full"):
            store.append([assessment(at(i), speed_rpm=1.0) for i in range(200)], [])
    store._writer.execute("PRAGMA max_page_count = 1000000")
    store.append([assessment(at(i), speed_rpm=1.0) for i in range(200)], [])

    assert n_rows(path, "assessment") == 200


def test_a_commit_that_is_refused_leaves_no_transaction_behind(store, path, execute):
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


@pytest.mark.long
def test_trends_are_read_while_others_are_written(store):
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


def test_a_closed_database_is_one_whole_file_also_after_reads(tmp_path):
    store = SqliteStore(tmp_path / "padwatch.sqlite3")
    assert store.gap_references.in_force() == []
    store.close()

    assert [path.name for path in tmp_path.iterdir() if "sqlite3" in path.name] == [
        "padwatch.sqlite3"
    ]


NOBODY = 65534
DATABASE = "padwatch.sqlite3"


def database_in(data: Path) -> Path:
    """Make a database in a data folder."""
    SqliteStore(data / DATABASE).close()
    return data / DATABASE


def log_of_somebody_else(data: Path) -> None:
    log = data / f"{database_in(data).name}-wal"
    log.touch()
    log.chmod(0o400)


def file_in_place_of_the_folder(data: Path) -> None:
    data.rmdir()
    data.touch()


def folder_that_cannot_be_made(data: Path) -> None:
    data.rmdir()
    data.parent.chmod(0o555)


GIVE_FILE = "may not read and write {data}/padwatch.sqlite3: change its owner to that user"
GIVE_FOLDER = "may not read or create the folder {data}: change its owner to that user"
CASES: dict[str, tuple[Callable[[Path], object], str]] = {
    "read-only file": (lambda data: database_in(data).chmod(0o444), GIVE_FILE),
    "unreadable file": (lambda data: database_in(data).chmod(0), GIVE_FILE),
    "read-only folder": (
        lambda data: database_in(data).parent.chmod(0o555),
        "may not create files in {data}: change its owner to that user",
    ),
    "log of somebody else": (
        log_of_somebody_else,
        "may not read and write {data}/padwatch.sqlite3-wal: change its owner to",
    ),
    "folder without permission": (lambda data: data.chmod(0), GIVE_FOLDER),
    "directory in its place": (
        lambda data: (data / DATABASE).mkdir(),
        "{data}/padwatch.sqlite3 is a folder, but must be the database file",
    ),
    "file in place of the folder": (
        file_in_place_of_the_folder,
        "{data} cannot be created because a file is in its place: move it",
    ),
    "folder that cannot be made": (folder_that_cannot_be_made, GIVE_FOLDER),
}


@pytest.fixture
def place() -> Iterator[Path]:
    """A folder that everybody can reach."""
    folder = Path(tempfile.mkdtemp(prefix="padwatch-"))
    yield folder
    for inner, _, _ in os.walk(folder):
        Path(inner).chmod(0o700)
    shutil.rmtree(folder)


def prepared(folder: Path, plant_text: str, prepare: Callable[[Path], object]) -> Path:
    """A plant file whose data folder has something wrong with it, all of it nobody's."""
    data = folder / "data"
    data.mkdir(parents=True)
    path = folder / "plant.toml"
    reached = plant_text.replace("port = 0", "port = 9")  # where nobody answers
    path.write_text(reached.replace('"var/demo"', f'"{data}"'))
    prepare(data)
    if os.geteuid() == 0:
        for one in (folder, *folder.rglob("*")):
            os.chown(one, NOBODY, NOBODY)
    return path


@contextmanager
def as_nobody() -> Iterator[None]:
    """Be a user without privileges for a while: root may do everything."""
    is_root = os.geteuid() == 0
    if is_root:
        os.setresgid(NOBODY, NOBODY, 0)
        os.setresuid(NOBODY, NOBODY, 0)
    try:
        yield
    finally:
        if is_root:
            os.setresuid(0, 0, 0)
            os.setresgid(0, 0, 0)


@pytest.mark.parametrize("name", CASES)
def test_each_is_told_in_one_sentence_with_what_to_do(place, plant_text, name, monkeypatch):
    # nobody may not run root's Python; the serving process is not needed before the database is
    monkeypatch.setattr(sys, "executable", shutil.which("true"))
    prepare, said = CASES[name]
    place.chmod(0o755)
    plant = prepared(place / "plant", plant_text, prepare)
    with as_nobody():
        result = CliRunner().invoke(app, ["run", str(plant), "--port", "0"])

    assert result.exit_code == 1, result.output
    assert said.format(data=plant.parent / "data") in result.stderr
    assert result.stderr.count("\n") == 1, result.stderr


def test_a_folder_that_is_not_there_is_made(path):
    with closing(SqliteStore(path.parent / "deeper" / "down" / path.name)) as store:
        assert not store.integrity.found


def test_an_empty_file_is_a_new_database_and_one_that_became_empty_is_told(path):
    path.parent.mkdir()
    path.touch()
    with closing(SqliteStore(path)) as store:
        assert not store.integrity.found
    path.write_bytes(b"")
    with closing(SqliteStore(path)) as store:
        assert [finding.kind for finding in store.integrity.found] == ["replaced"]


@pytest.mark.parametrize("n_before", [2, 3, len(MIGRATIONS) - 1])
def test_an_older_database_keeps_its_data_and_gets_new_tables(path, monkeypatch, n_before):
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
        store.gap_references.add(reference)

        gather_all(store)
        assert n_rows(path, "rollup_mark") == 1
        assert [gap.first_index for gap in store.gaps("U1", 0, 10)] == [2]
        assert [found.identity for found in store.alarms()] == [alarm.identity]
        assert store.gap_references.in_force() == [reference]
        newest = store.newest("U1", "UJB")
    assert newest is not None
    assert newest.readings["speed_rpm"].value == 92.3


BROKEN = "CREATE TABLE more (x TEXT) STRICT; DROP TABLE gap; CREATE TABLE more (x TEXT) STRICT;"


def test_a_migration_that_fails_leaves_the_database_as_it_was(store_place, monkeypatch):
    with closing(store_place.open()) as store:
        store.append([assessment(speed_rpm=92.3)], [])
    with monkeypatch.context() as next_release:
        next_release.setattr(schema, "MIGRATIONS", (*MIGRATIONS, BROKEN))
        with pytest.raises(StoreError, match=r'(table |relation ")more"? already exists'):
            store_place.open()

    with closing(store_place.open()) as store:  # which has a table gap
        assert list(store.trend(query()).series["speed_rpm"].mean) == [92.3]
        assert store.gaps("U1", 0, 10) == []


def test_a_migration_keeps_the_data_and_is_done_once(store_place, monkeypatch):
    with closing(store_place.open()) as store:
        store.append([assessment(speed_rpm=92.3)], [])
    monkeypatch.setattr(schema, "MIGRATIONS", (*MIGRATIONS, "CREATE TABLE more (x TEXT) STRICT;"))

    for _ in range(2):
        with closing(store_place.open()) as store:
            assert list(store.trend(query()).series["speed_rpm"].mean) == [92.3]
    assert store_place.execute("SELECT count(*) FROM more") == [(0,)]


def test_a_database_of_another_version_with_the_same_number_is_refused_in_words(store_place):
    store_place.open().close()
    store_place.execute("ALTER TABLE film_reading RENAME COLUMN ln_ck_x TO ln_ck")

    with pytest.raises(StoreError, match=r"another version of padwatch \(its table film_reading"):
        store_place.open()


def test_two_commands_that_upgrade_at_the_same_moment_find_the_newest_schema(tmp_path):
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
def test_a_database_of_another_program_is_refused_and_left_as_it_is(path, content):
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


def test_a_database_of_a_newer_padwatch_is_refused_by_its_schema_number(store_place):
    store_place.open().close()
    store_place.execute(NEWER[store_place.kind])

    said = f"schema version {NEWEST + 1}; this padwatch supports up to {NEWEST}; run the padwatch"
    with pytest.raises(StoreError, match=said):
        store_place.open()


def test_a_truncated_database_and_what_is_none_are_refused(path):
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


def test_live_and_replayed_results_never_share_a_database(store_place):
    for _ in range(2):
        store_place.open(Origin.LIVE).close()
    with pytest.raises(StoreError, match="holds live results and cannot be used for replay"):
        store_place.open(Origin.REPLAY)
