"""The disk: what it keeps files on is known; after its errors the connection is not trusted."""

import resource
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from rigs.assessments import assessment
from rigs.rolled_trends import n_rows
from rigs.store_fixtures import at

from service.store.holds import OVER_A_NETWORK, FileSystem, file_system_of
from service.store.port import StoreError
from service.store.sqlite import SqliteStore
from service.store.sqlite import connections as readers
from service.store.sqlite import connections as writer
from service.store.sqlite.connections import Readers
from service.store.sqlite.file import leaves_in_doubt


@contextmanager
def files_up_to(n_bytes: int) -> Iterator[None]:
    """Let no file of this process grow beyond that."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_limit_of_file_sizes_is_named_and_the_store_goes_on_when_it_is_raised(path: Path) -> None:
    batch = [[assessment(at(10 * n + i), speed_rpm=1.0) for i in range(10)] for n in range(100)]
    with closing(SqliteStore(path)) as store:
        first = store._writer
        refusal = pytest.raises(
            StoreError, match="the limit of file sizes, 1000000 bytes, is reached"
        )
        with files_up_to(1_000_000), refusal:
            for n_stored, some in enumerate(batch):  # noqa: B007 - the one that is refused
                store.append(some, [])
        store.append(batch[n_stored], [])

        assert store._writer is not first
        assert not store._file.marks.found
    assert n_rows(path, "assessment") == 10 * (n_stored + 1)


def test_a_full_disk_leaves_no_doubt_and_other_errors_do() -> None:
    full, torn = sqlite3.OperationalError("full"), sqlite3.OperationalError("disk I/O error")
    full.sqlite_errorcode = 13  # type: ignore[misc]
    torn.sqlite_errorcode = 10 | 4 << 8  # type: ignore[misc]

    assert not leaves_in_doubt(full)
    assert leaves_in_doubt(torn)
    assert not leaves_in_doubt(StoreError("refused"))


@pytest.mark.usefixtures("store")
def test_a_read_that_takes_too_long_is_ended(path: Path) -> None:
    now = iter([0.0] + 10_000 * [readers.LONGEST_S + 1.0])
    slow = Readers(path, lambda: next(now))

    with pytest.raises(sqlite3.OperationalError, match="interrupted"), slow.reading() as reader:
        reader.execute(
            "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 10000000)"
            " SELECT count(*) FROM n"
        ).fetchone()
    slow.close()


def test_the_log_is_cut_after_a_long_read(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    limit = 2_000_000
    monkeypatch.setattr(writer, "MAX_LOG_BYTES", limit)
    log = path.with_name(path.name + "-wal")
    with closing(SqliteStore(path)) as store:
        with closing(sqlite3.connect(path, isolation_level=None)) as reader:
            reader.execute("BEGIN")
            reader.execute("SELECT count(*) FROM assessment").fetchone()
            number = 0
            while log.stat().st_size < 5 * limit:
                store.append([assessment(at(number + i), speed_rpm=1.0) for i in range(50)], [])
                number += 50
            reader.execute("ROLLBACK")
        for _ in range(3):
            store.append([assessment(at(number), speed_rpm=1.0)], [])
            number += 1

        assert log.stat().st_size <= limit


def test_room_that_becomes_free_is_given_back(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(writer, "MIN_FREE_PAGES", 20)
    with closing(SqliteStore(path)) as store:
        store.append([assessment(at(i), speed_rpm=1.0) for i in range(400)], [])
        assert not store.retention.give_back()
        store._writer.execute("DELETE FROM assessment")
        store._writer.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        before = path.stat().st_size
        while store.retention.give_back():
            pass
        store._writer.execute("PRAGMA wal_checkpoint(TRUNCATE)")

        assert path.stat().st_size < 0.9 * before


ROOT = "22 1 254:0 / / rw,relatime shared:1 - ext4 /dev/vda rw"


def mounts(*kinds: tuple[str, str]) -> str:
    """A table in which folders are mounted, in order, as the kernel writes it."""
    lines = [
        f"{30 + n} 22 0:{n} / {point} rw,nosuid shared:{n} - {kind} server:/share rw"
        for n, (point, kind) in enumerate(kinds)
    ]
    return "\n".join([ROOT, *lines])


LOCAL = ("ext4", "xfs", "btrfs", "zfs", "f2fs")
FORGETFUL = ("tmpfs", "overlay", "vfat", "virtiofs", "fuse.encfs", "fuseblk")


@pytest.mark.parametrize("kind", [*sorted(OVER_A_NETWORK), *LOCAL, *FORGETFUL])
def test_a_folder_on_another_machine_or_one_that_may_forget_is_known_as_such(kind: str) -> None:
    found = file_system_of(Path("/plant/data"), lambda: mounts(("/plant", kind)))

    assert (found.kind, found.is_remote) == (kind, kind in OVER_A_NETWORK)
    if kind in LOCAL:
        assert found == FileSystem(kind)
    if kind in FORGETFUL:
        assert found.warning


def test_the_nearest_mount_counts_and_of_one_place_the_latest() -> None:
    table = mounts(("/a", "nfs4"), ("/a/b", "xfs"), ("/ab", "cifs"), ("/c", "xfs"), ("/c", "nfs"))
    kinds = {p: file_system_of(Path(p), lambda: table).kind for p in ("/a", "/a/b/d", "/abc", "/c")}

    assert kinds == {"/a": "nfs4", "/a/b/d": "xfs", "/abc": "ext4", "/c": "nfs"}


def test_a_link_leads_to_where_it_points(tmp_path: Path) -> None:
    (tmp_path / "far").mkdir()
    (tmp_path / "near").symlink_to(tmp_path / "far")
    table = mounts((str(tmp_path / "far"), "nfs4"))

    assert file_system_of(tmp_path / "near", lambda: table).is_remote


def test_a_mount_with_a_space_in_its_name_is_found() -> None:
    table = mounts((r"/my\040plant", "nfs4"))

    assert file_system_of(Path("/my plant/data"), lambda: table).kind == "nfs4"


@pytest.mark.parametrize("table", ["", "nonsense", "1 2 3 4\n - \n"])
def test_a_system_that_does_not_say_is_not_guessed_at(table: str) -> None:
    assert file_system_of(Path("/plant"), lambda: table) == FileSystem("")


def test_this_machine_says_what_it_keeps_files_on(tmp_path: Path) -> None:
    if not Path("/proc/self/mountinfo").exists():
        pytest.skip("the kernel has no table of mounts")
    assert file_system_of(tmp_path).kind
