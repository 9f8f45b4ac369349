"""Who is told of what, and messages that wait, are told or are given up."""

import asyncio
import itertools
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from core.alarms.alarm import Alarm, AlarmChange, AlarmIdentity, AlarmNews, AlarmRule, AlarmState
from core.alarms.life_cycle import update
from core.alarms.operation import (
    Acknowledge,
    ReturnToService,
    Shelve,
    TakeOutOfService,
    Unshelve,
    operate,
)
from core.limits import AlarmLevel, Judgement, unknown
from service.store.outbox import MessageState
from service.store.port import AlarmQuery, StoreError

T0 = 1_767_225_600_000_000_000
ALERT = Judgement(AlarmLevel.ALERT, value=160.25, limit=150.0, reason="above_limit")
DANGER = Judgement(AlarmLevel.DANGER, value=260.0, limit=250.0, reason="above_limit")
WELL = Judgement(value=3.0)
STANDS = Judgement(value=3.0, suppressed_by="standstill")

SHELVE, UNSHELVE = Shelve("A. Name", "cable", T0 + 10**15), Unshelve("A. Name")
ANY = AlarmLevel.ALERT
HIDDEN = (AlarmState.SHELVED, AlarmState.SUPPRESSED, AlarmState.OUT_OF_SERVICE)


class Life:
    """An alarm that lives, step by step, and is stored after each."""

    def __init__(self, store: Any, unit: str = "U1", kind: str = "order1_shaft_x") -> None:
        self.alarm, self.store, self.now_ns = Alarm(AlarmIdentity(unit, "UJB", kind)), store, T0

    def go(self, *steps: Any) -> None:
        for step in steps:
            self.now_ns += 10**9
            if isinstance(step, Judgement):
                self.alarm, events = update(self.alarm, step, self.now_ns, AlarmRule())
            else:
                asked = step if not callable(step) else step(self.alarm)
                self.alarm, events = operate(self.alarm, asked, self.now_ns)
            if events:
                self.store.append([], [], [AlarmNews(self.alarm, tuple(events))])


def told(store: Any, receiver: str = "desk", unit: str = "%") -> list[tuple[str, bool]]:
    """What a receiver is told, in order: the change, and whether the alarm is active then."""
    with store._reader() as reader:
        rows = reader.execute(
            "SELECT change, is_active FROM outbox JOIN alarm_event USING (alarm, number)"
            " WHERE receiver = ? AND unit LIKE ? ORDER BY outbox.id",
            (receiver, unit),
        )
        return [(change, bool(is_active)) for change, is_active in rows]


@pytest.mark.parametrize(
    ("lowest", "steps", "expected"),
    [
        (ANY, [ALERT, DANGER, ALERT, WELL], ["raised", "escalated", "eased", "returned"]),
        (ANY, [SHELVE, ALERT, WELL, UNSHELVE], []),
        (ANY, [SHELVE, ALERT, UNSHELVE, WELL], ["unshelved", "returned"]),
        (ANY, [ALERT, SHELVE, WELL, UNSHELVE], ["raised", "returned"]),
        (ANY, [STANDS, WELL, STANDS, WELL], []),
        (ANY, [ALERT, STANDS, WELL], ["raised", "returned"]),
        (ANY, [WELL, unknown("stale"), ALERT, unknown("stale")], ["raised"]),
        (AlarmLevel.DANGER, [ALERT, WELL, ALERT, DANGER, ALERT, WELL], ["escalated", "eased"]),
        (AlarmLevel.DANGER, [DANGER, WELL], ["raised", "returned"]),
    ],
)
def test_what_is_off_the_list_is_told_when_it_comes_back_active_and_ends_are_never_owed(
    lowest, steps, expected, room
):
    store = room.open_store(room.routed("desk", lowest_priority=lowest.name.lower()))

    Life(store).go(*steps)

    assert [change for change, _ in told(store)] == expected


def test_each_is_told_of_the_units_and_kinds_that_it_has_asked_for(room):
    store = room.open_store(
        room.routed("unit", units=("U2",)),
        room.routed("kind", kinds=("link_lost",)),
        room.routed("seen", changes=(AlarmChange.ACKNOWLEDGED,)),
    )

    Life(store, "U1", "link_lost").go(ALERT)
    Life(store, "U2").go(ALERT, lambda alarm: Acknowledge("A. Name", alarm.occurrence))

    found = {name: told(store, name) for name in ("unit", "kind", "seen")}
    assert found == {
        "unit": [("raised", True)],
        "kind": [("raised", True)],
        "seen": [("acknowledged", True)],
    }


NUMBERS = itertools.count()

STEPS = [
    ALERT,
    DANGER,
    WELL,
    STANDS,
    unknown("stale"),
    SHELVE,
    UNSHELVE,
    TakeOutOfService("B. Name", "overhaul"),
    ReturnToService("B. Name"),
    lambda alarm: Acknowledge("A. Name", alarm.occurrence),
]


@given(steps=st.lists(st.sampled_from(STEPS), max_size=14))
@settings(
    max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_what_was_told_last_agrees_with_the_alarm_list(steps, room):
    store = room.open_store()
    unit = f"unit-{next(NUMBERS)}"
    life = Life(store, unit)
    for step in steps:
        life.go(step)
        believed = [is_active for _, is_active in told(store, unit=unit)][-1:] == [True]
        if life.alarm.level is None:
            assert not believed
        elif life.alarm.state not in HIDDEN:
            assert believed
    store.close()


ROOT = Path(__file__).parents[3]


def test_an_event_that_cannot_be_queued_is_not_stored_either(room):
    store = room.open_store()
    store._writer.execute(
        "CREATE TRIGGER refuse BEFORE INSERT ON outbox BEGIN SELECT RAISE(ABORT, 'full'); END"
    )

    with pytest.raises(StoreError, match="full"):
        store.append([], [], [room.news(0)])
    assert list(store.alarm_events(AlarmQuery())) == []

    store._writer.execute("DROP TRIGGER refuse")
    store.append([], [], [room.news(0)])
    assert len(store.alarm_events(AlarmQuery())) == len(store.outbox.waiting("desk", 9)) == 1


def test_an_event_that_is_written_twice_is_told_once_even_after_it_was_delivered(room):
    store = room.open_store(room.routed("desk"), room.routed("office"))
    for _ in range(2):
        store.append([], [], [room.news(0)])
    (letter,) = store.outbox.waiting("desk", 9)
    store.outbox.finish(letter.id, MessageState.DELIVERED, "200", 1)

    store.append([], [], [room.news(0)])

    assert store.outbox.waiting("desk", 9) == []
    (other,) = store.outbox.waiting("office", 9)
    assert (other.event_id, other.body) == (letter.event_id, letter.body)


def test_what_was_told_is_neither_changed_nor_removed(room):
    store = room.open_store()
    store.append([], [], [room.news(0)])

    for order in ("DELETE FROM outbox", "UPDATE outbox SET body = '{}'"):
        with pytest.raises(Exception, match="kept"), store._writing() as writer:
            writer.execute(order)


def test_letters_that_were_given_up_wait_again_in_their_old_order(room):
    store = room.open_store()
    store.append([], [], [room.news(n) for n in range(4)])
    first, second, *_ = store.outbox.waiting("desk", 9)
    store.outbox.finish(first.id, MessageState.REFUSED, "401", 5)
    store.outbox.finish(second.id, MessageState.DELIVERED, "200", 6)

    assert store.outbox.revive("desk", 7) == 1

    waiting = store.outbox.waiting("desk", 9)
    assert [letter.event_id for letter in waiting] == ["id-0", "id-2", "id-3"]


DELIVER_AND_HANG = """
import asyncio, sys, threading
from pathlib import Path
from acquisition.clock import SystemClock
from service.notifications.sender import Receiver, Sender
from service.notifications.webhook import Webhook
from service.settings.notifications import WebhookSettings
from service.store.sqlite import SqliteStore

store = SqliteStore(Path(sys.argv[1]))

class Outbox(type(store.outbox)):
    def finish(self, *done):
        print("answered", flush=True)
        threading.Event().wait()

clock, settings = SystemClock(), WebhookSettings(kind="webhook", id="desk", url=sys.argv[2])
desk = Receiver("desk", settings, Webhook(settings, clock))
asyncio.run(Sender(desk, Outbox(store._writing, store._reader), clock).run())
"""


async def test_what_was_answered_but_not_noted_before_a_crash_comes_again_with_the_same_id(room):
    server = await room.web(room.answers("200 OK"))
    store = room.open_store()
    store.append([], [], [room.news(0), room.news(1)])
    store.close()

    program = await asyncio.create_subprocess_exec(
        *(sys.executable, "-c", DELIVER_AND_HANG, str(room.path), server.url),
        stdout=subprocess.PIPE,
        cwd=ROOT,
    )
    assert program.stdout is not None
    said = await program.stdout.readline()
    program.send_signal(signal.SIGKILL)
    await program.communicate()

    store = room.open_store(prefix="later")
    store.append([], [], [room.news(2)])
    await room.delivered(server, store)
    assert said == b"answered\n"
    assert [r.id for r in server.requests] == ["id-0", "id-0", "id-1", "later-0"]
    assert server.requests[0].body == server.requests[1].body


async def test_the_end_of_the_service_waits_for_a_delivery_to_be_noted(room):
    server, store = await room.web(room.answers("200 OK")), room.open_store()
    store.append([], [], [room.news(0)])
    noting, may_note = asyncio.Event(), threading.Event()
    finish, loop = store.outbox.finish, asyncio.get_running_loop()

    def slow_finish(*done: Any) -> None:
        loop.call_soon_threadsafe(noting.set)
        may_note.wait(30)
        finish(*done)

    store.outbox.finish = slow_finish
    sending = asyncio.create_task(room.sender(server, store).run())
    await noting.wait()
    sending.cancel()
    for _ in range(20):
        await asyncio.sleep(0)
    assert not sending.done()
    may_note.set()
    await asyncio.wait([sending])

    assert store.outbox.waiting("desk", 9) == []
