"""Accounts, sessions, keys, the set-up token and the outbox, in both databases."""

import pytest
from harness.places import Place

from core.alarms.alarm import Alarm, AlarmIdentity, AlarmNews, AlarmRule
from core.alarms.judgements import OrderVector, VectorReference
from core.alarms.life_cycle import update
from core.condition.operating_state import OperatingState
from core.limits import AlarmLevel, Judgement
from service.security.keys import ApiKey
from service.security.roles import Role
from service.security.sessions import Session
from service.store.access_port import AccessRefusedError
from service.store.audit_port import AuditQuery
from service.store.commands_port import Command, OpenCommand
from service.store.film_port import BaselineStep, StoredStep
from service.store.gap_reference import GapReference, ReferenceSource
from service.store.outbox_port import LetterState
from service.store.port import StoreError
from service.store.sql_store import SqlStore
from service.store.vector_reference_port import SetVectorReference

TOKEN, OTHER = b"t" * 32, b"o" * 32
LATER = 10**18
GAP = GapReference("U1", "UJB", 5, "A", (1.0, 2.0), None, ReferenceSource.GIVEN)
VECTOR = SetVectorReference(
    VectorReference("U1", "UJB", OperatingState.FULL_LOAD, {"shaft_x": OrderVector(60.0)}),
    *(6, "A", ""),
)


def test_the_first_account_takes_the_token_that_was_offered_last(store: SqlStore) -> None:
    set_up = store.access.set_up
    assert set_up.offer(OTHER, LATER)
    assert set_up.offer(TOKEN, LATER)

    assert not set_up.holds(OTHER, 1)
    assert set_up.holds(TOKEN, 1)
    assert not set_up.holds(TOKEN, LATER)
    assert set_up.take(TOKEN, "anna", "hash", 1)
    assert not set_up.take(TOKEN, "berta", "hash", 1)
    assert not set_up.offer(TOKEN, LATER)
    assert [account.name for account in store.access.accounts.all()] == ["anna"]


def test_what_is_written_again_because_nobody_could_tell_counts_once(store: SqlStore) -> None:
    step = StoredStep("U1", "UJB", None, BaselineStep.RENEWED, 7, "A", "overhaul", 7)
    key = ApiKey("k1", "wall", TOKEN, Role.VIEWER, ("U1",), 8, LATER)
    command = Command("c1", "U1", "alarm", "{}", "A", None, 9, LATER)
    for _ in range(2):
        store.add_reference(GAP)
        store.order1_references.add(VECTOR)
        store.films.add_steps([step])
        store.access.accounts.add("anna", Role.ADMIN, "hash", 10)
        store.access.keys.add(key)
        store.commands.ask(command)

    assert store.reference_history("U1", "UJB") == [GAP]
    assert store.order1_references.history("U1", "UJB") == [VECTOR]
    assert store.films.steps("U1", "UJB") == [step]
    assert store.commands.open(["U1"]) == [OpenCommand(command, None)]
    assert len(store.audit.entries(AuditQuery())) == 5


def test_the_only_admin_stays_and_a_new_password_ends_sessions(store: SqlStore) -> None:
    accounts, sessions = store.access.accounts, store.access.sessions
    accounts.add("anna", Role.ADMIN, "hash", 1)
    accounts.add("berta", Role.VIEWER, "hash", 2)
    with pytest.raises(AccessRefusedError, match="already"):
        accounts.add("anna", Role.VIEWER, "hash", 3)
    with pytest.raises(AccessRefusedError, match="only admin"):
        accounts.set_role("anna", Role.VIEWER, 4)
    assert not sessions.add(Session(TOKEN, "berta", 5, 5), 2, 0)
    for n in range(18):
        assert sessions.add(Session(bytes([n]) * 32, "berta", 5 + n, 5), 1, 0)
    assert sessions.get(bytes([1]) * 32) is None
    found = sessions.get(bytes([2]) * 32)
    assert found is not None
    assert (found[0].digest, found[1].name, found[1].role) == (
        *(bytes([2]) * 32, "berta"),
        Role.VIEWER,
    )
    accounts.set_password("berta", "another", 30)
    assert sessions.get(bytes([2]) * 32) is None
    accounts.remove("berta", 31)
    actions = [entry.action for entry in store.audit.entries(AuditQuery(object="berta"))]
    assert actions == ["account.removed", "account.password_set", "account.added"]


def test_a_revoked_key_stays_revoked_and_no_key_is_forgotten(store: SqlStore) -> None:
    keys = store.access.keys
    key = ApiKey("k1", "wall", TOKEN, Role.VIEWER, ("U1",), 1, LATER)
    keys.add(key)
    assert keys.get("k1") == key
    keys.see("k1", 5)
    assert keys.revoke("k1", 6)
    assert not keys.revoke("k1", 7)
    assert [(found.used_ns, found.revoked_ns) for found in keys.all()] == [(5, 6)]
    for change in ("UPDATE api_key SET revoked_ns = NULL", "DELETE FROM api_key"):
        with pytest.raises(StoreError, match="revoked"), store.database.writing() as writer:
            writer.execute(change)
    with pytest.raises(StoreError):
        keys.add(key)


def test_nothing_waits_for_anybody_in_a_new_outbox(store: SqlStore) -> None:
    assert list(store.outbox.backlogs()) == []
    assert not store.outbox.urgent("desk")
    assert store.outbox.expire("desk", 5, "too old", 6) == store.outbox.revive("desk", 7) == 0
    store.outbox.finish(1, LetterState.DELIVERED, "200", 8)
    assert list(store.alarms()) == []


@pytest.mark.parametrize("table", ["gap_reference", "vector_reference", "alarm_event", "audit"])
def test_what_is_on_record_is_never_changed_or_taken_away(
    store: SqlStore, store_place: Place, table: str
) -> None:
    store.add_reference(GAP)
    store.order1_references.add(VECTOR)
    alarm = Alarm(AlarmIdentity("U1", "UJB", "order1_shaft_x"))
    news = AlarmNews(*update(alarm, Judgement(AlarmLevel.ALERT), 7, AlarmRule()))
    store.append([], [], [news])
    column = "author" if table.endswith("reference") else "actor"
    for statement in (f"UPDATE {table} SET {column} = 'x'", f"DELETE FROM {table}"):  # noqa: S608
        with pytest.raises(store_place.refusal, match="kept"):
            store_place.execute(statement)
