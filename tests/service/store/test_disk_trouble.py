"""Disks that are full, slow or unfit, and damaged rows that the scrubbing loop finds."""

import asyncio
import resource
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rigs.assessments import assessment
from rigs.rolled_trends import n_rows
from rigs.store_fixtures import at

from service.measuring.integrity import IntegrityMonitor
from service.measuring.live_view import LiveView
from service.runtime.heartbeats import PATIENCE_S, Heartbeats
from service.runtime.periodic import LOOK_S
from service.store.access.identities import Role, Session
from service.store.audit import AuditQuery
from service.store.holds import OVER_A_NETWORK, FileSystem, file_system_of
from service.store.loops import ScrubLoop
from service.store.port import StoreError
from service.store.seals import Place
from service.store.sqlite import SqliteStore
from service.store.sqlite import checking as scrubbing
from service.store.sqlite import connections as readers
from service.store.sqlite import connections as writer
from service.store.sqlite.checking import Scrubber, findings
from service.store.sqlite.connections import Readers
from service.store.sqlite.database import SqliteDatabase
from service.store.sqlite.file import leaves_in_doubt
from service.store.sqlite.store import open_access_file


@contextmanager
def files_up_to(n_bytes: int) -> Iterator[None]:
    """Let no file of this process grow beyond that."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_limit_of_file_sizes_is_named_and_the_store_goes_on_when_it_is_raised(path):
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


def test_a_full_disk_leaves_no_doubt_and_other_errors_do():
    full, torn = sqlite3.OperationalError("full"), sqlite3.OperationalError("disk I/O error")
    full.sqlite_errorcode = 13  # type: ignore[misc]
    torn.sqlite_errorcode = 10 | 4 << 8  # type: ignore[misc]

    assert not leaves_in_doubt(full)
    assert leaves_in_doubt(torn)
    assert not leaves_in_doubt(StoreError("refused"))


@pytest.mark.usefixtures("store")
def test_a_read_that_takes_too_long_is_ended(path):
    now = iter([0.0] + 10_000 * [readers.LONGEST_S + 1.0])
    slow = Readers(path, lambda: next(now))

    with pytest.raises(sqlite3.OperationalError, match="interrupted"), slow.reading() as reader:
        reader.execute(
            "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 10000000)"
            " SELECT count(*) FROM n"
        ).fetchone()
    slow.close()


def test_the_log_is_cut_after_a_long_read(path, monkeypatch):
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


def test_room_that_becomes_free_is_given_back(path, monkeypatch):
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
def test_a_folder_on_another_machine_or_one_that_may_forget_is_known_as_such(kind):
    found = file_system_of(Path("/plant/data"), lambda: mounts(("/plant", kind)))

    assert (found.kind, found.is_remote) == (kind, kind in OVER_A_NETWORK)
    if kind in LOCAL:
        assert found == FileSystem(kind)
    if kind in FORGETFUL:
        assert found.warning


def test_the_nearest_mount_counts_and_of_one_place_the_latest():
    table = mounts(("/a", "nfs4"), ("/a/b", "xfs"), ("/ab", "cifs"), ("/c", "xfs"), ("/c", "nfs"))
    kinds = {p: file_system_of(Path(p), lambda: table).kind for p in ("/a", "/a/b/d", "/abc", "/c")}

    assert kinds == {"/a": "nfs4", "/a/b/d": "xfs", "/abc": "ext4", "/c": "nfs"}


def test_a_link_leads_to_where_it_points(tmp_path):
    (tmp_path / "far").mkdir()
    (tmp_path / "near").symlink_to(tmp_path / "far")
    table = mounts((str(tmp_path / "far"), "nfs4"))

    assert file_system_of(tmp_path / "near", lambda: table).is_remote


def test_a_mount_with_a_space_in_its_name_is_found():
    table = mounts((r"/my\040plant", "nfs4"))

    assert file_system_of(Path("/my plant/data"), lambda: table).kind == "nfs4"


@pytest.mark.parametrize("table", ["", "nonsense", "1 2 3 4\n - \n"])
def test_a_system_that_does_not_say_is_not_guessed_at(table):
    assert file_system_of(Path("/plant"), lambda: table) == FileSystem("")


def test_this_machine_says_what_it_keeps_files_on(tmp_path):
    if not Path("/proc/self/mountinfo").exists():
        pytest.skip("the kernel has no table of mounts")
    assert file_system_of(tmp_path).kind


N = 40


@pytest.fixture(autouse=True)
def _few_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scrubbing, "ROWS_AT_ONCE", 7)


@pytest.fixture(autouse=True)
def _filled(path: Path) -> None:
    with closing(SqliteStore(path)) as store:
        store.append([assessment(at(n), speed_rpm=float(n)) for n in range(N)], [])


def once_around(store: SqliteStore) -> int:
    """How many looks it takes."""
    n_looks = 1
    while not store.integrity.check_some():
        n_looks += 1
    return n_looks


def test_altered_and_missing_rows_are_found_and_are_those_that_the_command_finds(path, execute):
    execute("UPDATE assessment SET coverage = 0.5 WHERE time_ns = ?", (at(20),))
    execute("DELETE FROM assessment WHERE time_ns = ?", (at(33),))
    execute("UPDATE series SET bearing = 'LJB'")
    with closing(SqliteStore(path)) as store:
        once_around(store)
        found = store.integrity.damaged

    assert set(found) == {
        Place("assessment", f"series 1, time_ns {at(20)}"),
        Place("assessment", f"series 1, time_ns {at(33)}", is_missing=True),
        Place("series", "id 1"),
    }
    assert {f"{place.table}: {place.key}" for place in found} == {
        finding.detail for finding in findings(path)
    }


def test_of_what_is_whole_nothing_is_said_however_often_it_is_looked_at(path):
    with closing(SqliteStore(path)) as store:
        assert once_around(store) == once_around(store) > 2 * N / 7
        assert store.integrity.n_damaged == 0


def test_after_a_restart_it_goes_on_where_it_was_also_among_keys_of_bytes(tmp_path, monkeypatch):
    path = tmp_path / "access.sqlite3"
    monkeypatch.setattr(scrubbing, "REMEMBER_EVERY", 1)
    monkeypatch.setattr(scrubbing, "ROWS_AT_ONCE", 1)
    with closing(open_access_file(path)) as access:
        access.accounts.add("anna", Role.ADMIN, "hash", 1)
        for n in (0x80, 0xFF):
            assert access.sessions.add(Session(bytes([n]) * 32, "anna", 2, 3), 1, 0)

    with closing(SqliteDatabase(path, None)) as database:
        scrubber, n_looks = Scrubber(database, database.seals, database.damage), 1
        while not scrubber.check_some():
            n_looks += 1

    n_with_restarts, is_around = 0, False
    while not is_around:
        with closing(SqliteDatabase(path, None)) as database:
            is_around = Scrubber(database, database.seals, database.damage).check_some()
        n_with_restarts += 1
    assert n_with_restarts == n_looks


@pytest.mark.parametrize(
    "place",
    [
        *("nonsense", "[1]", '["gone", false, null]', '["gap", true, [{}]]'),
        *('["gap", false, [{"hex": 1}]]', '["gap", false, [{"hex": "f"}]]'),
    ],
)
def test_a_damaged_place_makes_it_begin_anew(path, place, execute):
    with closing(SqliteStore(path)) as store:
        n_looks = once_around(store)
    execute(f"UPDATE seal_walk SET place = '{place}'")  # noqa: S608
    with closing(SqliteStore(path)) as store:
        assert once_around(store) == n_looks


def test_keys_that_are_no_text_stop_nothing(path, execute):
    with closing(SqliteStore(path)) as store:
        for name in ("a", "b"):
            with store.database.writing() as writer:
                writer.execute(
                    "INSERT INTO shaft_response (unit, created_ns, document) VALUES (?, 1, '')",
                    (name,),
                )
    execute("UPDATE shaft_response SET unit = CAST(x'ff80' AS TEXT) WHERE unit = 'b'")
    with closing(SqliteStore(path)) as store:
        once_around(store)
        assert {place.table for place in store.integrity.damaged} == {"shaft_response"}


async def test_its_findings_are_in_the_audit_trail_and_make_the_alarm(path, stepped_clock, execute):
    execute(f"DELETE FROM assessment WHERE time_ns = {at(3)}")  # noqa: S608
    with closing(SqliteStore(path)) as store:
        soundness = IntegrityMonitor(store, stepped_clock, LiveView([], stepped_clock, 30.0))
        loop = ScrubLoop(store.integrity, stepped_clock)
        while not await loop.look():
            pass
        await soundness.look()
        (told,) = store.audit.entries(AuditQuery(action="store.row_damaged"))

    assert soundness.trouble is not None
    assert told.reason == "the row is missing"


async def test_a_disk_that_stands_still_makes_the_loop_rest_but_not_fall_silent(stepped_clock):
    beats = Heartbeats(stepped_clock)
    slow_disk: Any = SimpleNamespace(check_some=lambda: stepped_clock.step(30.0))
    loop = ScrubLoop(slow_disk, stepped_clock)
    slept_s = []

    async def sleep(duration_s: float) -> None:
        slept_s.append(duration_s)
        stepped_clock.step(duration_s)
        assert not beats.troubles
        if len(slept_s) == 20:
            raise asyncio.CancelledError

    stepped_clock.sleep = sleep
    with suppress(asyncio.CancelledError):
        await beats.tend("scrub", loop.run)

    assert max(slept_s) <= LOOK_S
    assert sum(slept_s) > PATIENCE_S
