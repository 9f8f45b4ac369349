"""Entries follow one another, whoever writes them, and are never changed."""

import sqlite3
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from dataclasses import replace

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from core.samples.gaps import Gap
from service.store.access.audit_entries import MAX_DOCUMENT, MAX_NAME, AuditAction, AuditEntry
from service.store.access.audit_verification import HEAD_DIFFERED, AuditHead, head_path, read_head
from service.store.audit import AuditQuery, Trail
from service.store.port import StoreError, UnitGap
from service.store.sqlite import SqliteStore
from service.store.sqlite.store import file_trail

Build = Callable[..., AuditAction]


def all_of(store: SqliteStore) -> list[AuditEntry]:
    """Entries, oldest first."""
    return list(reversed(store.audit.entries(AuditQuery(limit=10_000))))


def test_what_was_done_is_read_back_newest_first_and_page_by_page(store, deed):
    store.audit.record([deed(n) for n in range(5)])
    first = store.audit.entries(AuditQuery(limit=2))
    second = store.audit.entries(AuditQuery(limit=2, before=first[-1].number))

    assert [entry.number for entry in [*first, *second]] == [5, 4, 3, 2]
    newest = first[0]
    assert (newest.actor, newest.source, newest.action) == ("A. Name", "api", "alarm.shelved")
    assert newest.before == '{"state":"normal"}'
    assert newest.after == '{"by":"\\u00dcn\\u00efcode","state":"shelved","until_s":2.5}'
    assert newest.previous_hash == first[1].hash


def test_entries_are_found_by_actor_action_object_and_time(store, deed):
    deeds = [deed(0), deed(1, actor="B"), deed(2, action="x.y"), deed(3, object="U2")]
    store.audit.record(deeds)

    def numbers(**wanted: object) -> list[int]:
        return [e.number for e in store.audit.entries(AuditQuery(**wanted))]  # type: ignore[arg-type]

    assert numbers(actor="B") == [2]
    assert numbers(action="x.y") == [3]
    assert numbers(object="U2") == [4]
    assert numbers(start_ns=deeds[1].time_ns, end_ns=deeds[3].time_ns) == [3, 2]
    assert numbers(actor="' OR 1=1 --") == []


def test_the_database_refuses_to_change_entries(store, path, deed):
    store.audit.record([deed(0), deed(1)])
    for statement in (
        "UPDATE audit SET actor = 'nobody'",
        "DELETE FROM audit",
        "INSERT OR REPLACE INTO audit SELECT * FROM audit WHERE number = 1",
        "INSERT INTO audit SELECT number + 7, time_ns, actor, source, peer, action, object, before,"
        " after, reason, previous_hash, hash FROM audit WHERE number = 1",
    ):
        with closing(sqlite3.connect(path)) as other, pytest.raises(sqlite3.IntegrityError):
            other.execute(statement)
    assert file_trail(path).verify().is_whole


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(actor=st.text(st.characters(), max_size=400), reason=st.text(st.characters()))
@example("🦭" * 500, "a\ud800b\r\n\u202e")
@example("\x00", "=HYPERLINK(1)")
@example("", "'; DROP TABLE audit; --")
def test_any_name_and_any_reason_can_be_written(store, path, deed, actor, reason):
    texts = {"object": reason, "action": reason, "peer": actor, "after": {"a": actor}}
    store.audit.record([deed(actor=actor, reason=reason, **texts)])

    newest = store.audit.entries(AuditQuery(limit=1))[0]
    assert len(newest.actor) <= MAX_NAME
    assert newest.actor[:200] == actor.encode("utf-8", "replace").decode()[:200]
    assert file_trail(path).verify().is_whole


def test_a_document_without_end_is_kept_as_its_beginning(store, deed):
    store.audit.record([deed(after={"text": "x" * (2 * MAX_DOCUMENT)})])
    [entry] = all_of(store)
    assert entry.after is not None
    assert len(entry.after) < 2000
    assert f'"n_characters":{2 * MAX_DOCUMENT + 11}' in entry.after


def test_several_writers_leave_no_hole(store, path, deed):
    with closing(SqliteStore(path)) as other, ThreadPoolExecutor(6) as pool:
        list(pool.map(lambda n: (store, other)[n % 2].audit.record([deed(n)] * 3), range(24)))

    verdict = file_trail(path).verify()
    assert (verdict.finding, verdict.n_entries, verdict.n_behind) == (None, 72, 0)
    assert read_head(head_path(path)) == AuditHead(72, verdict.hash)


def test_an_entry_that_is_written_while_the_trail_is_read_is_no_crash(store, path, deed):
    @contextmanager
    def read_late() -> Iterator[sqlite3.Connection]:
        store.audit.record([deed(1)])
        with closing(sqlite3.connect(path)) as reader:
            yield reader

    store.audit.record([deed(0)])
    verdict = Trail(read_late, head_path(path)).verify()
    assert (verdict.finding, verdict.n_entries, verdict.n_behind) == (None, 2, 0)


def test_a_crash_before_the_head_was_written_is_no_tampering_and_is_repaired(store, path, deed):
    store.audit.record([deed(0)])
    before = head_path(path).read_bytes()
    store.audit.record([deed(1), deed(2)])
    head_path(path).write_bytes(before)  # as if the process had ended in between

    after_crash = file_trail(path).verify()
    with closing(SqliteStore(path)) as again:
        again.audit.record([deed(3)])
    repaired = file_trail(path).verify()

    assert (after_crash.finding, after_crash.n_behind, after_crash.contradictions) == (None, 2, ())
    assert (repaired.finding, repaired.n_behind, repaired.contradictions) == (None, 0, ())
    assert repaired.n_entries == 4


def test_a_crash_before_the_very_first_entry_is_no_tampering(path, deed):
    SqliteStore(path).close()
    empty = file_trail(path).verify()
    store = SqliteStore(path)
    store.audit.record([deed(0)])
    head_path(path).write_bytes(
        b'{"format": "padwatch-audit-head", "number": 0, "hash": "%s"}' % (b"0" * 64)
    )
    after_crash = file_trail(path).verify()
    store.close()

    assert (empty.is_whole, empty.n_entries) == (True, 0)
    assert (after_crash.is_whole, after_crash.n_behind) == (True, 1)


@pytest.mark.parametrize("with_head", [True, False])
def test_a_cut_trail_stays_noticed_after_the_service_has_gone_on(store, path, deed, *, with_head):
    store.audit.record([deed(n) for n in range(4)])
    with closing(sqlite3.connect(path)) as other:
        other.executescript("DROP TRIGGER audit_kept; DELETE FROM audit WHERE number > 2")
    if not with_head:
        head_path(path).unlink()
    store.audit.record([deed(9)])
    store.audit.record([deed(10)])

    verdict = file_trail(path).verify()
    told = all_of(store)[2]
    assert (verdict.is_whole, verdict.contradictions) == (True, (3,))
    assert (told.actor, told.action) == ("padwatch", HEAD_DIFFERED)
    assert told.reason == (
        "the head file names entry 4, but the trail ends at 2"
        if with_head
        else f"the head file {head_path(path).name} does not exist"
    )


def test_a_database_that_was_put_in_the_place_of_another_tells_so(path, deed):
    for _ in range(2):
        path.unlink(missing_ok=True)
        with closing(SqliteStore(path)) as store:
            store.audit.record([deed(0)])
    assert file_trail(path).verify().contradictions == (1,)


def test_a_head_that_cannot_be_written_stops_no_deed_and_is_written_later(store, path, deed):
    head = head_path(path)
    store.audit.record([deed(0)])
    head.unlink()
    (head / "in the way").mkdir(parents=True)
    store.audit.record([deed(1)])
    error = store.audit.head_error
    store.audit.record([deed(2)])
    (head / "in the way").rmdir()
    head.rmdir()
    store.append([], [])  # whatever comes next

    assert error is not None
    assert str(head) in error
    assert store.audit.head_error is None
    assert [entry.action for entry in all_of(store)].count(HEAD_DIFFERED) == 1
    assert file_trail(path).verify().is_whole


def test_results_leave_the_head_alone(store, path, deed):
    store.audit.record([deed(0)])
    before = head_path(path).stat()
    for n in range(20):
        store.append([], [UnitGap("U1", Gap(1, n, 1, n))])
    assert head_path(path).stat().st_ino == before.st_ino
    assert head_path(path).stat().st_mtime_ns == before.st_mtime_ns


def test_a_transaction_that_fails_leaves_no_entry(store, path, deed):
    store.audit.record([deed(0)])
    with pytest.raises(StoreError):
        store.audit.record([deed(1), replace(deed(2), time_ns="soon")])  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="not JSON compliant"):
        store.audit.record([deed(1), deed(2, after={"value": float("nan")})])
    store.audit.record([deed(3)])
    assert [entry.number for entry in all_of(store)] == [1, 2]
    assert file_trail(path).verify().is_whole


def test_a_trail_is_verified_while_others_write(store, path, deed):
    with ThreadPoolExecutor(2) as pool:
        writing = pool.map(lambda n: store.audit.record([deed(n)]), range(100))
        verdicts = [file_trail(path).verify() for _ in range(30)]
        list(writing)
    assert [(v.finding, v.contradictions) for v in verdicts] == [(None, ())] * 30


def test_where_there_is_no_trail_that_is_said(tmp_path):
    with pytest.raises(StoreError, match="the database does not exist"):
        file_trail(tmp_path / "nothing.sqlite3").verify()
    sqlite3.connect(tmp_path / "other.sqlite3").close()
    (tmp_path / "broken.sqlite3").write_bytes(b"no database at all" * 500)
    for name in ("other", "broken"):
        with pytest.raises(StoreError):
            file_trail(tmp_path / f"{name}.sqlite3").verify()
