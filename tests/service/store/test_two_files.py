"""Accounts have a file of their own; what is written again counts once in both databases."""

import shutil
from collections.abc import Callable
from contextlib import closing

import pytest
from rigs.store_fixtures import at, gap

from core.alarms.alarm import Alarm, AlarmIdentity, AlarmNews, AlarmRule
from core.alarms.judgements import OrderVector, VectorReference
from core.alarms.life_cycle import update
from core.condition.operating_state import OperatingState
from core.limits import AlarmLevel, Judgement
from service.store.access.audit_entries import AuditAction
from service.store.access.identities import ApiKey, Role
from service.store.audit import AuditQuery
from service.store.baselines import BaselineStep, StoredStep
from service.store.outbox import MessageState
from service.store.port import StoreError
from service.store.references import GapReference, ReferenceSource, SetVectorReference
from service.store.sharing import Command, OpenCommand
from service.store.sqlite import SqliteStore
from service.store.sqlite.store import SqliteReader, open_access_file
from service.store.store import Store

REFERENCE = GapReference("U1", "UJB", 5, "A", (1.0, 2.0), None, ReferenceSource.GIVEN)

WRITES: list[Callable[[Store], object]] = [
    lambda store: store.gap_references.add(REFERENCE),
    lambda store: store.audit.record([AuditAction(1, "A", "x", "y")]),
    lambda store: store.append([], [gap(at(1))]),
    lambda store: store.commands.ask(Command("c", "U1", "alarm", "{}", "A", None, 9, 10)),
    lambda store: store.integrity.adopt(1),
]


def test_a_store_to_serve_reads_what_is_written_meanwhile_and_writes_nothing(path):
    with closing(SqliteStore(path)) as store, closing(SqliteReader(path)) as reader:
        assert reader.gaps("U1", 0, 2**62) == []
        store.append([], [gap(at(1))])
        store.audit.record([AuditAction(1, "A", "x", "y")])
        before = path.stat().st_mtime_ns, path.with_name(path.name + "-wal").read_bytes()

        assert len(reader.gaps("U1", 0, 2**62)) == 1
        for write in WRITES[:-1]:
            with pytest.raises(StoreError, match="this process only reads the database"):
                write(reader)
        assert list(WRITES[-1](reader)) == []  # type: ignore[call-overload]

        assert [entry.actor for entry in reader.audit.entries(AuditQuery())] == ["A"]
        assert before == (path.stat().st_mtime_ns, path.with_name(path.name + "-wal").read_bytes())


def test_a_store_to_serve_leaves_out_damaged_rows(path, execute):
    with closing(SqliteStore(path)) as store:
        store.append([], [gap(at(n), first_index=100 * n) for n in range(3)])
        execute("UPDATE gap SET n_samples = 7 WHERE first_index = 100")
        with closing(SqliteReader(path)) as reader:
            assert len(reader.gaps("U1", 0, 2**62)) == 2
            assert reader.integrity.n_damaged == 1


def test_a_store_to_serve_needs_a_database_and_notices_when_it_is_removed(path):
    with pytest.raises(StoreError, match="the database does not exist; start padwatch"):
        SqliteReader(path)
    with closing(SqliteStore(path)), closing(SqliteReader(path)) as reader:
        path.unlink()
        with pytest.raises(StoreError, match="removed while padwatch runs"):
            reader.alarms()


def test_neither_file_is_taken_for_the_other(tmp_path):
    results, access = tmp_path / "padwatch.sqlite3", tmp_path / "access.sqlite3"
    SqliteStore(results).close()
    open_access_file(access).close()

    with pytest.raises(StoreError, match="is not a padwatch database"):
        SqliteStore(access)
    with pytest.raises(StoreError, match="is not a padwatch database"):
        open_access_file(results)


def test_an_older_copy_of_the_accounts_is_reported_and_then_accepted(tmp_path):
    path, older = tmp_path / "access.sqlite3", tmp_path / "older"
    with closing(open_access_file(path)) as access:
        access.accounts.add("anna", Role.ADMIN, "hash", 1)
    shutil.copy(path, older)
    with closing(open_access_file(path)) as access:
        access.accounts.add("bert", Role.ADMIN, "hash", 1)
        assert (access.accept(2), access.trouble) == (None, None)
    shutil.copy(older, path)

    with closing(open_access_file(path)) as access:
        found = access.accept(3)
        assert found is not None
        assert "the database was rolled back" in found
        assert access.trouble == found
        told = [entry.action for entry in access.audit.entries(AuditQuery())]
        assert told == ["store.rolled_back", "audit.head_differed", "account.added"]
    with closing(open_access_file(path)) as access:
        assert (access.accept(4), access.trouble) == (None, None)


TOKEN, OTHER = b"t" * 32, b"o" * 32
LATER = 10**18
GAP = GapReference("U1", "UJB", 5, "A", (1.0, 2.0), None, ReferenceSource.GIVEN)
VECTOR = SetVectorReference(
    VectorReference("U1", "UJB", OperatingState.FULL_LOAD, {"shaft_x": OrderVector(60.0)}),
    *(6, "A", ""),
)


def test_accounts_and_keys_that_are_written_again_count_once(store_place):
    key = ApiKey("k1", "wall", TOKEN, Role.VIEWER, ("U1",), 8, LATER)
    with closing(store_place.open_access()) as access:
        for _ in range(2):
            access.accounts.add("anna", Role.ADMIN, "hash", 10)
            access.keys.add(key)
        assert len(access.audit.entries(AuditQuery())) == 2


def test_what_is_written_again_because_nobody_could_tell_counts_once(store):
    step = StoredStep("U1", "UJB", None, BaselineStep.RENEWED, 7, "A", "overhaul", 7)
    command = Command("c1", "U1", "alarm", "{}", "A", None, 9, LATER)
    for _ in range(2):
        store.gap_references.add(GAP)
        store.order1_references.add(VECTOR)
        store.films.add_steps([step])
        store.commands.ask(command)

    assert store.gap_references.history("U1", "UJB") == [GAP]
    assert store.order1_references.history("U1", "UJB") == [VECTOR]
    assert store.films.steps("U1", "UJB") == [step]
    assert store.commands.open(["U1"]) == [OpenCommand(command, None)]
    assert len(store.audit.entries(AuditQuery())) == 3


def test_nothing_waits_for_anybody_in_a_new_outbox(store):
    assert list(store.outbox.backlogs()) == []
    assert not store.outbox.urgent("desk")
    assert store.outbox.expire("desk", 5, "too old", 6) == store.outbox.revive("desk", 7) == 0
    store.outbox.finish(1, MessageState.DELIVERED, "200", 8)
    assert list(store.alarms()) == []


@pytest.mark.parametrize("table", ["gap_reference", "vector_reference", "alarm_event", "audit"])
def test_what_is_on_record_is_never_changed_or_taken_away(store, store_place, table):
    store.gap_references.add(GAP)
    store.order1_references.add(VECTOR)
    alarm = Alarm(AlarmIdentity("U1", "UJB", "order1_shaft_x"))
    news = AlarmNews(*update(alarm, Judgement(AlarmLevel.ALERT), 7, AlarmRule()))
    store.append([], [], [news])
    column = "author" if table.endswith("reference") else "actor"
    for statement in (f"UPDATE {table} SET {column} = 'x'", f"DELETE FROM {table}"):  # noqa: S608
        with pytest.raises(store_place.refusal, match="kept"):
            store_place.execute(statement)
