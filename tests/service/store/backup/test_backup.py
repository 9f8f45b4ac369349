"""Copies of a database that is in use: whole, verified, and put back only where that is safe."""

import os
import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from threading import Event, Thread

import pytest
from rigs.memory_folder import path_in_memory  # noqa: F401 - a fixture

from core.samples.gaps import Gap
from service.settings.storage import Origin
from service.store.backup import BackupError, back_up, checked, restore
from service.store.port import UnitGap
from service.store.schema import MIGRATIONS
from service.store.sqlite import SqliteStore
from service.store.sqlite.migrating import APPLICATION_IDS

NOW_NS = 1_767_225_600_000_000_000
HOUR_NS = 3_600_000_000_000


def write_gaps(store: SqliteStore, first: int, n: int) -> None:
    gaps = [UnitGap("U1", Gap(1, number, 7, NOW_NS + number)) for number in range(first, first + n)]
    store.append([], gaps)


def gaps_in(path: Path) -> int:
    with closing(SqliteStore(path)) as store:
        return len(store.gaps("U1", 0, 1 << 62))


@pytest.fixture
def database(tmp_path: Path) -> Path:
    return tmp_path / "data" / "padwatch.sqlite3"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "copies"


@pytest.fixture
def copy(database: Path, folder: Path) -> Path:
    """A copy of a database with 100 gaps; the database has 50 more by now."""
    with closing(SqliteStore(database)) as store:
        write_gaps(store, 0, 100)
        path = back_up(database, folder, NOW_NS, 3).path
        write_gaps(store, 100, 50)
    return path


def test_a_copy_of_a_database_in_use_is_one_private_file_with_all_committed(database, folder):
    with closing(SqliteStore(database)) as store:
        write_gaps(store, 0, 100)
        made = back_up(database, folder, NOW_NS, 3)
        write_gaps(store, 100, 1)  # the service goes on

    assert made.path == folder / "padwatch-20260101T000000Z.sqlite3"
    assert made.content == checked(made.path)
    assert made.content.schema == len(MIGRATIONS)
    assert made.content.n_rows["gap"] == 100
    assert made.path.stat().st_mode & 0o777 == 0o600
    assert list(folder.iterdir()) == [made.path]
    assert gaps_in(database) == 101


def test_a_copy_is_of_one_moment_while_the_service_writes_without_pause(database, folder):
    done = Event()
    with closing(SqliteStore(database)) as store:

        def write() -> None:
            number = 0
            while not done.is_set():
                write_gaps(store, number, 10)  # ten in one transaction
                number += 10

        writing = Thread(target=write)
        writing.start()
        try:
            found = [
                back_up(database, folder, NOW_NS + n * HOUR_NS, 9).content.n_rows["gap"]
                for n in range(8)
            ]
        finally:
            done.set()
            writing.join()

    assert found == sorted(found)
    assert all(n_gaps % 10 == 0 for n_gaps in found)


def test_only_the_newest_copies_are_kept_and_other_files_are_left_alone(database, folder):
    folder.mkdir()
    (folder / "padwatch-notes.sqlite3").write_text("mine", encoding="utf-8")
    (folder / ".padwatch-20250101T000000Z.sqlite3.part").write_text("a crash", encoding="utf-8")
    with closing(SqliteStore(database)):
        made = [back_up(database, folder, NOW_NS + n * HOUR_NS, 2) for n in range(4)]

    assert made[-1].removed == (made[1].path,)
    assert {path.name for path in folder.iterdir()} == {
        "padwatch-notes.sqlite3",
        made[2].path.name,
        made[3].path.name,
    }


def test_a_clock_that_was_set_back_does_not_cost_the_copy_just_made(database, folder):
    with closing(SqliteStore(database)):
        late = back_up(database, folder, NOW_NS + HOUR_NS, 1)
        early = back_up(database, folder, NOW_NS, 1)

    assert early.removed == (late.path,)
    assert list(folder.iterdir()) == [early.path]


def damage(path: Path) -> None:
    """Overwrite the file's middle, and leave its head as it is."""
    with path.open("r+b") as file:
        file.seek(path.stat().st_size // 2)
        file.write(b"\xff" * 8192)


def test_a_damaged_database_gives_no_copy_and_costs_no_older_one(database, copy, folder):
    with closing(sqlite3.connect(database)) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    damage(database)

    with pytest.raises(BackupError):
        back_up(database, folder, NOW_NS + HOUR_NS, 1)

    assert list(folder.iterdir()) == [copy]


def test_what_is_not_there_gives_no_copy_and_makes_no_folder(database, folder):
    with pytest.raises(BackupError, match="the database does not exist"):
        back_up(database, folder, NOW_NS, 1)
    assert not folder.exists()


def test_a_copy_takes_the_place_of_a_database_that_is_kept_beside_it(database, copy):
    done = restore(copy, database, NOW_NS)

    assert gaps_in(database) == 100
    assert done.before == database.with_name("padwatch.sqlite3.before-20260101T000000Z")
    assert gaps_in(done.before) == 150
    assert gaps_in(copy) == 100


def test_a_copy_is_put_where_there_is_nothing_or_only_damage(copy, tmp_path):
    elsewhere = tmp_path / "new" / "padwatch.sqlite3"

    assert restore(copy, elsewhere, NOW_NS).before is None
    assert gaps_in(elsewhere) == 100
    elsewhere.write_bytes(b"\x00nothing of use" * 1000)
    restore(copy, elsewhere, NOW_NS)
    assert gaps_in(elsewhere) == 100


def test_nothing_is_restored_while_the_service_has_the_database_open(database, copy):
    with closing(SqliteStore(database)) as store:
        with pytest.raises(BackupError, match="is in use; stop padwatch"):
            restore(copy, database, NOW_NS)
        write_gaps(store, 150, 1)

    assert gaps_in(database) == 151
    names = [path.name for path in database.parent.iterdir()]
    assert not [name for name in names if "restoring" in name or "before" in name]


def crashed(database: Path) -> None:
    """Leave the files as a power cut leaves them: rows in a log that nobody has taken in."""
    aside = database.with_name("aside")
    with closing(SqliteStore(database)) as store:
        write_gaps(store, 150, 25)
        for ending in ("", "-wal"):
            source = database.with_name(database.name + ending)
            shutil.copyfile(source, aside.with_name(aside.name + ending))
    for ending in ("", "-wal"):
        os.replace(aside.with_name(aside.name + ending), f"{database}{ending}")


def test_the_log_of_a_crash_does_not_get_into_what_is_restored(database, copy):
    crashed(database)

    done = restore(copy, database, NOW_NS)

    assert done.before is not None
    assert gaps_in(database) == 100
    assert gaps_in(done.before) == 175


def spoil(copy: Path, *statements: str) -> None:
    with closing(sqlite3.connect(copy)) as connection:
        for statement in statements:
            connection.execute(statement)
        connection.commit()


SPOILT: dict[str, tuple[Callable[[Path], None], str]] = {
    "newer": (
        lambda copy: spoil(copy, f"PRAGMA user_version = {len(MIGRATIONS) + 1}"),
        f"has schema version {len(MIGRATIONS) + 1}; this padwatch supports up to {len(MIGRATIONS)}",
    ),
    "a replay's": (
        lambda copy: spoil(copy, f"PRAGMA application_id = {APPLICATION_IDS[Origin.REPLAY]}"),
        "is not the padwatch database of a live plant",
    ),
    "damaged": (damage, "damaged|malformed"),
    "cut short": (lambda copy: os.truncate(copy, copy.stat().st_size // 2), "damaged|malformed"),
    "no database": (lambda copy: copy.write_text("x" * 9000) and None, "not a database"),
    "gone": (lambda copy: copy.unlink(), "the backup does not exist"),
}


@pytest.mark.parametrize("name", SPOILT)
def test_a_copy_that_is_not_whole_or_not_ours_is_refused_and_changes_nothing(name, database, copy):
    do, words = SPOILT[name]
    do(copy)

    with pytest.raises(BackupError, match=words):
        restore(copy, database, NOW_NS)

    assert gaps_in(database) == 150


@pytest.mark.usefixtures("copy")
def test_a_database_is_not_restored_from_itself(database):
    with pytest.raises(BackupError, match="is the database itself"):
        restore(database, database, NOW_NS)
    assert gaps_in(database) == 150
