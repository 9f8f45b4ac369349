"""What is done in the store stands in the trail with it, or not at all."""

import json
import sqlite3
from collections.abc import Callable
from contextlib import closing
from typing import Any

import pytest

from core.alarms.alarm import Alarm, AlarmIdentity, AlarmNews, AlarmRule
from core.alarms.judgements import OrderVector, VectorReference
from core.alarms.life_cycle import update
from core.alarms.operation import Acknowledge, Comment, Shelve, TakeOutOfService, operate
from core.condition.operating_state import OperatingState
from core.limits import AlarmLevel, Judgement
from service.app.service_audit import start_deeds
from service.store.access.audit_entries import ActedNews, Acting, AuditEntry, Source, acting_as
from service.store.audit import AuditQuery
from service.store.baselines import BaselineStep, StoredStep
from service.store.port import StoreError
from service.store.references import GapReference, ReferenceSource, SetVectorReference
from service.store.sqlite import SqliteStore
from service.store.sqlite.store import file_trail

T0 = 1_767_225_600_000_000_000
ALERT = Judgement(AlarmLevel.ALERT, value=160.25, limit=150.0, reason="above_limit")
ENGINEER = Acting(Source.API, "192.0.2.7")


def newest(store: SqliteStore) -> AuditEntry:
    return store.audit.entries(AuditQuery(limit=1))[0]


def count(store: SqliteStore) -> int:
    return len(store.audit.entries(AuditQuery(limit=1000)))


def raised() -> AlarmNews:
    identity = AlarmIdentity("U1", "UJB", "order1_shaft_x")
    return AlarmNews(*update(Alarm(identity), ALERT, T0, AlarmRule()))


@pytest.mark.parametrize(
    ("action", "change", "after"),
    [
        (Acknowledge("A. Name", 1, "seen"), "acknowledged", "acknowledged"),
        (Shelve("A. Name", "cable", T0 + 10**12), "shelved", "shelved"),
        (TakeOutOfService("A. Name", "overhaul"), "taken_out_of_service", "out_of_service"),
        (Comment("A. Name", "look at this"), "commented", "unacknowledged"),
    ],
)
def test_what_people_do_to_alarms_is_told_with_before_and_after(store, action, change, after):
    news = raised()
    done = ActedNews(*operate(news.alarm, action, T0 + 5), peer="192.0.2.7")
    store.append([], [], [news])
    n_before = count(store)
    store.append([], [], [done])
    store.append([], [], [done])  # as after a write of which it is not known whether it succeeded

    told = newest(store)
    assert (n_before, count(store)) == (0, 1)
    assert (told.actor, told.action) == ("A. Name", f"alarm.{change}")
    assert told.object == "U1:UJB:order1_shaft_x"
    assert (told.source, told.peer, told.time_ns) == ("api", "192.0.2.7", T0 + 5)
    assert json.loads(told.before or "")["state"] == "unacknowledged"
    document = json.loads(told.after or "")
    assert document["state"] == after
    if isinstance(action, Shelve):
        shelf = {"actor": action.actor, "reason": action.reason}
        until = {"since_ns": T0 + 5, "until_ns": T0 + 10**12}
        assert document["shelf"] == shelf | until


def step(kind: BaselineStep, version: int | None = 1, actor: str = "B. Name") -> StoredStep:
    from_ns = T0 if kind is BaselineStep.RENEWED else None
    return StoredStep("U1", "UJB", version, kind, T0, actor, "because", from_ns)


def test_what_is_done_to_baselines_is_told_with_where_they_stand(store):
    steps = [step(BaselineStep.LEARNED, actor="padwatch"), step(BaselineStep.ACCEPTED)]
    with acting_as(ENGINEER):
        store.films.add_steps(steps)
        accepted = newest(store)
        store.films.add_steps([step(BaselineStep.FROZEN)])
        store.films.add_steps([step(BaselineStep.RENEWED, None)])
    renewed = newest(store)

    assert [accepted.number, renewed.number] == [1, 3]
    assert (accepted.action, accepted.object) == ("baseline.accepted", "U1:UJB:1")
    assert (accepted.source, accepted.peer) == ("api", "192.0.2.7")
    assert json.loads(accepted.before or "")["in_force"] is None
    assert json.loads(accepted.after or "")["in_force"] == 1
    assert json.loads(renewed.before or "")["is_frozen"] is True
    assert json.loads(renewed.after or "")["renewed_ns"] == T0
    assert renewed.object == "U1:UJB"
    store.films.add_steps([step(BaselineStep.ACCEPTED, actor="padwatch")])
    own = newest(store)
    assert (own.actor, own.source, own.peer) == ("padwatch", "padwatch", None)


def gap_reference(x_um: float = 1998.5) -> GapReference:
    return GapReference(
        "U1", "UJB", T0, "C. Name", (x_um, 2003.1), None, ReferenceSource.GIVEN, "overhaul"
    )


def test_references_are_told_with_those_that_they_follow(store):
    with acting_as(Acting(Source.COMMAND_LINE, "anna on host")):
        store.gap_references.add(gap_reference())
        store.gap_references.add(gap_reference(2001.0))
    told = newest(store)
    assert (told.actor, told.source, told.peer) == ("C. Name", "command_line", "anna on host")
    assert (told.action, told.object, told.reason) == ("gap_reference.set", "U1:UJB", "overhaul")
    assert json.loads(told.before or "")["gap_reference_um"] == [1998.5, 2003.1]
    assert json.loads(told.after or "")["gap_reference_um"] == [2001.0, 2003.1]


def vector_reference(amplitude_um_pk: float, state: OperatingState) -> SetVectorReference:
    vectors = {"shaft_x": OrderVector(amplitude_um_pk, 12.5)}
    found = VectorReference("U1", "UJB", state, vectors)
    return SetVectorReference(found, T0, "D. Name", "note")


def test_references_of_1x_follow_those_of_their_operating_state(store):
    full, part = OperatingState.FULL_LOAD, OperatingState.PART_LOAD
    for amplitude_um_pk, state in ((10.0, full), (20.0, part), (11.0, full)):
        store.order1_references.add(vector_reference(amplitude_um_pk, state))
    told = newest(store)
    assert (told.action, told.object) == ("order1_reference.set", "U1:UJB:full_load")
    assert json.loads(told.before or "")["vectors"]["shaft_x"]["amplitude_um_pk"] == 10.0
    assert json.loads(told.after or "")["vectors"]["shaft_x"]["amplitude_um_pk"] == 11.0


def test_what_cannot_be_told_is_not_done_and_the_other_way_round(store, path):
    with closing(sqlite3.connect(path)) as other:
        other.execute(
            "CREATE TRIGGER full BEFORE INSERT ON audit BEGIN SELECT RAISE(ABORT, 'x'); END"
        )
    news = raised()
    done = AlarmNews(*operate(news.alarm, Comment("A", "text"), T0 + 5))
    writes: list[Callable[[], Any]] = [
        lambda: store.gap_references.add(gap_reference()),
        lambda: store.films.add_steps([step(BaselineStep.ACCEPTED)]),
        lambda: store.order1_references.add(vector_reference(1.0, OperatingState.FULL_LOAD)),
        lambda: store.append([], [], [news, done]),
    ]
    for write in writes:
        with pytest.raises(StoreError):
            write()
    assert (store.gap_references.in_force(), store.films.steps("U1", "UJB"), store.alarms()) == (
        [],
        [],
        [],
    )
    assert store.order1_references.in_force() == []

    swapped = "DROP TRIGGER full; CREATE TRIGGER full BEFORE INSERT ON baseline_step"
    with closing(sqlite3.connect(path)) as other:
        other.executescript(f"{swapped} BEGIN SELECT RAISE(ABORT, 'x'); END")
    with pytest.raises(StoreError):
        store.films.add_steps([step(BaselineStep.FROZEN)])
    assert count(store) == 0
    assert file_trail(path).verify().is_whole


def test_a_start_tells_whether_the_configuration_is_another(store):
    first = {"version": "1.0", "configuration": "aa", "origin": "live"}
    other = first | {"version": "1.1", "configuration": "bb"}
    told = []
    for release in (first, first, other):
        starts = store.audit.entries(AuditQuery(limit=1, action="service.started"))
        deeds = start_deeds(release, starts[0] if starts else None, T0)
        store.audit.record(deeds)
        told.append([(deed.action, deed.before, deed.after) for deed in deeds])

    assert told[0] == told[1] == [("service.started", None, first)]
    before, after = {"configuration": "aa"}, {"configuration": "bb"}
    assert told[2][0] == ("configuration.changed", before, after)
