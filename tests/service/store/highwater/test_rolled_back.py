"""Databases that are not the one that was here last: cut, replaced, put back, copied."""

import os
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from rigs.assessments import assessment
from rigs.tiers import covering

from service.store.audit import AuditQuery
from service.store.backup import back_up, restore
from service.store.highwater.commits import Kind, MarkFinding
from service.store.highwater.mark import MarkFile, mark_path
from service.store.port import StoreError, TrendQuery
from service.store.sqlite import SqliteStore

T0 = 1_767_225_600_000_000_000
N_KEPT, N_LATER = 20, 25
EVERYTHING = TrendQuery("U1", "UJB", ("speed_rpm",), 0, 2**62, 5000, 2**62)


def fill(store: SqliteStore, numbers: range) -> None:
    """A transaction for each number."""
    for n in numbers:
        store.append([assessment(T0 + n * 1_000_000_000, speed_rpm=float(n))], [])


def filled(path: Path, numbers: range) -> None:
    """Open a store, write a transaction for each number, and close it."""
    with closing(SqliteStore(path)) as store:
        fill(store, numbers)


def speeds(store: SqliteStore) -> list[float | None]:
    return list(store.trend(EVERYTHING).series["speed_rpm"].mean)


def opened(path: Path) -> tuple[list[MarkFinding], list[float | None]]:
    """What a service that starts finds, and what it goes on with."""
    with closing(SqliteStore(path)) as store:
        return list(store.integrity.adopt(T0)), speeds(store)


def image(path: Path, folder: Path) -> Path:
    """The data folder as it is now, as after the death of the process."""
    shutil.copytree(path.parent, folder)
    return folder / path.name


def beside(path: Path, suffix: str) -> Path:
    return path.with_name(path.name + suffix)


@pytest.fixture
def crashed(path: Path, tmp_path: Path) -> Iterator[Path]:
    """A folder whose log holds the last transactions, as kill -9 leaves it."""
    store = SqliteStore(path)
    fill(store, range(N_KEPT))
    store._writer.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    fill(store, range(N_KEPT, N_KEPT + N_LATER))
    yield image(path, tmp_path / "crashed")
    store.close()


def test_after_a_crash_nothing_is_missing_and_nothing_is_said(crashed):
    assert beside(crashed, "-wal").stat().st_size
    assert opened(crashed) == ([], [float(n) for n in range(N_KEPT + N_LATER)])


def cut(log: Path, share: float) -> None:
    os.truncate(log, int(share * log.stat().st_size))


def flip(log: Path, share: float) -> None:
    content = bytearray(log.read_bytes())
    content[int(share * len(content))] ^= 4
    log.write_bytes(content)


SHARES = [0.0, 0.2, 0.5, 0.8, 0.99]


@pytest.mark.parametrize(("share", "spoil"), covering(SHARES, [cut, flip]))
def test_a_log_that_was_spoilt_is_told_with_the_number_of_transactions(crashed, share, spoil):
    spoil(beside(crashed, "-wal"), share)

    (finding,), left = opened(crashed)

    assert finding.kind is Kind.ROLLED_BACK
    assert finding.n_missing == N_KEPT + N_LATER - len(left) > 0
    assert left == [float(n) for n in range(len(left))]
    assert share or len(left) == N_KEPT


def test_an_old_copy_put_in_place_by_hand_is_told_once_and_in_the_audit_trail(path, tmp_path):
    filled(path, range(3))
    old = image(path, tmp_path / "old")
    filled(path, range(3, 10))
    shutil.copyfile(old, path)

    with closing(SqliteStore(path)) as store:
        (finding,) = store.integrity.adopt(T0)
        (told,) = store.audit.entries(AuditQuery(action="store.rolled_back"))

    assert finding.n_missing == 8  # seven results, and the one with which the store was opened
    assert told.reason == finding.detail
    assert told.after == '{"n_transactions_missing":8}'
    assert opened(path)[0] == []


def test_what_a_command_finds_is_left_for_the_service_to_tell(path, tmp_path):
    SqliteStore(path).close()
    old = image(path, tmp_path / "old")
    filled(path, range(2))
    shutil.copyfile(old, path)
    for _ in range(5):  # commands write, too: as many transactions as are missing, and more
        filled(path, range(1))

    (finding,), _ = opened(path)

    assert (finding.kind, finding.n_missing) == (Kind.ROLLED_BACK, 3)


def test_a_database_that_is_gone_is_told_by_the_empty_one_after_it(path):
    filled(path, range(3))
    path.unlink()

    (finding,), left = opened(path)

    assert (finding.kind, left) == (Kind.REPLACED, [])
    assert opened(path)[0] == []


@pytest.mark.parametrize("content", [None, b"", b"\0" * 8192])
def test_a_mark_that_is_lost_is_told_and_made_anew(path, content):
    filled(path, range(3))
    mark_path(path).unlink()
    if content is not None:
        mark_path(path).write_bytes(content)

    (finding,), left = opened(path)

    assert (finding.kind, len(left)) == (Kind.MARK_LOST, 3)
    assert opened(path)[0] == []


@pytest.mark.parametrize("has_mark", [True, False])
def test_a_restored_backup_is_what_somebody_wanted_and_gets_a_mark_if_it_had_none(
    path, tmp_path, has_mark
):
    with closing(SqliteStore(path)) as store:
        fill(store, range(3))
        made = back_up(path, tmp_path / "copies", T0, 3)
        fill(store, range(3, 10))
    if not has_mark:  # as of a padwatch from before there were marks
        with closing(sqlite3.connect(made.path)) as old:
            old.execute("DROP TABLE high_water")
            old.commit()
    restore(made.path, path, T0)

    assert opened(path) == ([], [0.0, 1.0, 2.0])
    assert mark_path(path).exists()


def test_a_mark_that_cannot_be_written_does_not_undo_what_is_on_the_disk(path):
    with closing(SqliteStore(path)) as store:
        mark_path(path).unlink()
        mark_path(path).mkdir()
        fill(store, range(3))
        said = store.integrity.mark_error
        assert len(speeds(store)) == 3
        mark_path(path).rmdir()
    assert said is not None
    assert "Is a directory" in said


def test_the_mark_is_written_before_a_transaction_is_acknowledged_and_not_when_it_is_refused(path):
    file = MarkFile(mark_path(path))
    with closing(SqliteStore(path)) as store:
        before = file.read().n_commits
        for n in range(5):
            fill(store, range(n, n + 1))
            assert file.read().n_commits == before + n + 1
        newest = file.read()
        store._writer.execute(
            "CREATE TRIGGER refuse BEFORE INSERT ON assessment BEGIN SELECT RAISE(ABORT, 'no'); END"
        )
        with pytest.raises(StoreError, match="no"):
            fill(store, range(9, 10))
        assert file.read() == newest
