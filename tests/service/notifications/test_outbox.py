"""Letters and events are on the disk together or not at all; crashes and restarts between."""

import asyncio
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from service.store.outbox import MessageState
from service.store.port import AlarmQuery, StoreError

ROOT = Path(__file__).parents[3]


def test_an_event_that_cannot_be_queued_is_not_stored_either(room: Any) -> None:
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


def test_an_event_that_is_written_twice_is_told_once_even_after_it_was_delivered(room: Any) -> None:
    store = room.open_store(room.routed("desk"), room.routed("office"))
    for _ in range(2):
        store.append([], [], [room.news(0)])
    (letter,) = store.outbox.waiting("desk", 9)
    store.outbox.finish(letter.id, MessageState.DELIVERED, "200", 1)

    store.append([], [], [room.news(0)])

    assert store.outbox.waiting("desk", 9) == []
    (other,) = store.outbox.waiting("office", 9)
    assert (other.event_id, other.body) == (letter.event_id, letter.body)


def test_what_was_told_is_neither_changed_nor_removed(room: Any) -> None:
    store = room.open_store()
    store.append([], [], [room.news(0)])

    for order in ("DELETE FROM outbox", "UPDATE outbox SET body = '{}'"):
        with pytest.raises(Exception, match="kept"), store._writing() as writer:
            writer.execute(order)


def test_letters_that_were_given_up_wait_again_in_their_old_order(room: Any) -> None:
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


async def test_what_was_answered_but_not_noted_before_a_crash_comes_again_with_the_same_id(
    room: Any,
) -> None:
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
    await program.wait()

    store = room.open_store(prefix="later")
    store.append([], [], [room.news(2)])
    await room.delivered(server, store)
    assert said == b"answered\n"
    assert [r.id for r in server.requests] == ["id-0", "id-0", "id-1", "later-0"]
    assert server.requests[0].body == server.requests[1].body


async def test_the_end_of_the_service_waits_for_a_delivery_to_be_noted(room: Any) -> None:
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
