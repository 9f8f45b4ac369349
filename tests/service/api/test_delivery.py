"""Who is told of alarms, over HTTP."""

from typing import Any

from core.alarms.alarm import Alarm, AlarmIdentity, AlarmNews, AlarmRule
from core.alarms.life_cycle import update
from core.limits import AlarmLevel, Judgement
from service.store.outbox import MessageState, OutboxMessage
from service.store.sqlite import SqliteStore

ALERT = Judgement(AlarmLevel.ALERT, value=160.25, limit=150.0, reason="above_limit")


def news(subject: str) -> AlarmNews:
    identity = AlarmIdentity("U1", subject, "order1_shaft_x")
    return AlarmNews(*update(Alarm(identity), ALERT, 5, AlarmRule()))


async def test_what_waits_for_somebody_who_has_left_the_plant_file_is_not_forgotten(
    service: Any, store: SqliteStore
) -> None:
    found = await service.json("/api/v1/delivery")
    assert (found["n_waiting"], found["n_failing"], found["receivers"]) == (0, 0, [])
    ids = iter(("a", "b", "c"))
    store._address = lambda *_: [
        OutboxMessage(
            "desk", next(ids), "{}", 10**18, is_urgent=False, is_active=True, closes=False
        )
    ]
    for subject in ("UJB", "LJB", "TJB"):
        store.append([], [], [news(subject)])
    first, second, _ = store.outbox.waiting("desk", 9)
    store.outbox.finish(first.id, MessageState.REFUSED, "410 Gone", 2 * 10**18)
    store.outbox.finish(second.id, MessageState.DELIVERED, "200", 3 * 10**18)

    found = await service.json("/api/v1/delivery")

    (desk,) = found["receivers"]
    assert (desk["id"], desk["state"], desk["kind"]) == ("desk", "not_in_the_plant_file", None)
    assert (desk["n_waiting"], desk["waiting_since"]) == (1, "2001-09-09T01:46:40.000Z")
    assert desk["n_dead"] == 1
    assert desk["last_dead"] == {
        "event_id": "a",
        "outcome": "refused",
        "reason": "410 Gone",
        "time": "2033-05-18T03:33:20.000Z",
    }
    assert desk["last_delivered"] == "2065-01-24T05:20:00.000Z"
