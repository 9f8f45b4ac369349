"""Writes that are repeated, an outbox that is new, and what is kept for good, in both databases."""

import pytest
from harness.places import Place

from core.alarms.alarm import Alarm, AlarmIdentity, AlarmNews, AlarmRule
from core.alarms.judgements import OrderVector, VectorReference
from core.alarms.life_cycle import update
from core.condition.operating_state import OperatingState
from core.limits import AlarmLevel, Judgement
from service.store.access.identities import ApiKey, Role
from service.store.audit import AuditQuery
from service.store.baselines import BaselineStep, StoredStep
from service.store.outbox import MessageState
from service.store.references import GapReference, ReferenceSource, SetVectorReference
from service.store.sharing import Command, OpenCommand
from service.store.store import Store

TOKEN, OTHER = b"t" * 32, b"o" * 32
LATER = 10**18
GAP = GapReference("U1", "UJB", 5, "A", (1.0, 2.0), None, ReferenceSource.GIVEN)
VECTOR = SetVectorReference(
    VectorReference("U1", "UJB", OperatingState.FULL_LOAD, {"shaft_x": OrderVector(60.0)}),
    *(6, "A", ""),
)


def test_what_is_written_again_because_nobody_could_tell_counts_once(store: Store) -> None:
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


def test_nothing_waits_for_anybody_in_a_new_outbox(store: Store) -> None:
    assert list(store.outbox.backlogs()) == []
    assert not store.outbox.urgent("desk")
    assert store.outbox.expire("desk", 5, "too old", 6) == store.outbox.revive("desk", 7) == 0
    store.outbox.finish(1, MessageState.DELIVERED, "200", 8)
    assert list(store.alarms()) == []


@pytest.mark.parametrize("table", ["gap_reference", "vector_reference", "alarm_event", "audit"])
def test_what_is_on_record_is_never_changed_or_taken_away(
    store: Store, store_place: Place, table: str
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
