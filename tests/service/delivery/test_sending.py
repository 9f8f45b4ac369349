"""From the outbox to a web server that does all that web servers do."""

import asyncio
import json
import random
from datetime import time
from typing import Any
from zoneinfo import ZoneInfo

import pytest

from core.alarms.alarm import AlarmLevel, Condition
from service.delivery.quiet import QuietHours
from service.delivery.sender import SenderState
from service.store.outbox_port import LetterState
from service.store.sqlite import SqliteStore

DANGER = Condition(AlarmLevel.DANGER, value=260.0, limit=250.0, reason="above_limit")


def events(store: SqliteStore) -> list[tuple[str, str, int, str]]:
    """Every letter there ever was: event, state, attempts in vain and answers, by number."""
    with store._reader() as reader:
        found = reader.execute("SELECT event_id, state, n_attempts, answer FROM outbox ORDER BY id")
        return found.fetchall()


async def test_each_event_is_told_once_and_in_order(room: Any) -> None:
    server, store = await room.web(room.answers("204 No Content")), room.open_store()
    store.append([], [], [room.news(n) for n in range(20)])
    sender = room.sender(server, store)

    async with room.running(sender):
        await room.settled(sender, store)

    assert [r.id for r in server.requests] == [f"id-{n}" for n in range(20)]
    assert [json.loads(r.body)["subject"] for r in server.requests] == [f"B{n}" for n in range(20)]
    assert {state for _, state, *_ in events(store)} == {"delivered"}


async def test_news_is_told_as_soon_as_the_sender_is_woken(room: Any) -> None:
    server, store = await room.web(room.answers("200 OK")), room.open_store()
    sender = room.sender(server, store)

    async with room.running(sender):
        for n in range(3):
            store.append([], [], [room.news(n)])
            sender.wake()
            await server.until(n + 1)

    assert [r.id for r in server.requests] == ["id-0", "id-1", "id-2"]


async def breaks_off(_: object, writer: asyncio.StreamWriter) -> None:
    writer.write(b"HTTP/1.1 20")


async def says_nothing(*_: object) -> None:
    """Closes without an answer."""


async def talks_nonsense(_: object, writer: asyncio.StreamWriter) -> None:
    writer.write(b"220 mail.example ESMTP\r\n\r\n" * 10)


async def sends_endless_headers(_: object, writer: asyncio.StreamWriter) -> None:
    writer.write(b"HTTP/1.1 200 OK\r\n")
    while True:
        writer.write(b"X-More: " + b"x" * 1000 + b"\r\n")
        await writer.drain()


async def announces_for_ever(_: object, writer: asyncio.StreamWriter) -> None:
    for _ in range(2000):
        writer.write(b"HTTP/1.1 100 Continue\r\n\r\n")
        await writer.drain()


@pytest.mark.parametrize(
    "fault",
    [
        "500 Internal Server Error",
        "503 Service Unavailable",
        "408 Request Timeout",
        "425 Too Early",
        "429 Too Many Requests",
        "301 Moved Permanently",
        "101 Switching",
        breaks_off,
        says_nothing,
        talks_nonsense,
        sends_endless_headers,
        announces_for_ever,
    ],
)
async def test_what_may_pass_is_tried_again_with_the_same_message_before_any_later_one(
    fault: Any, room: Any
) -> None:
    faulty = room.answers(fault) if isinstance(fault, str) else fault
    server, store = (
        await room.web(faulty, faulty, faulty, room.answers("200 OK")),
        room.open_store(),
    )
    store.append([], [], [room.news(0), room.news(1)])
    sender = room.sender(server, store)

    async with room.running(sender):
        await room.settled(sender, store)

    assert [r.id for r in server.requests] == ["id-0"] * 4 + ["id-1"]
    assert len({r.body for r in server.requests[:4]}) == 1
    first, second, third = room.clock.slept_s[:3]
    assert 0.5 <= first <= 1.0 <= second <= 2.0 <= third <= 4.0
    assert [n for _, _, n, _ in events(store)] == [4, 1]


async def test_a_receiver_that_asks_for_time_gets_it_up_to_the_limit(room: Any) -> None:
    asks = [
        "Retry-After: 7",
        "Retry-After: 99999999999999",
        "Retry-After: soon",
        "Retry-After: Thu, 01 Jan 2026 00:00:40 GMT",
    ]
    server = await room.web(
        *(room.answers("429 Too Many", ask) for ask in asks), room.answers("200 OK")
    )
    store = room.open_store()
    store.append([], [], [room.news(0)])
    sender = room.sender(server, store, max_retry_s=20.0)

    async with room.running(sender):
        await room.settled(sender, store)

    seven, capped, own, date = room.clock.slept_s[:4]
    assert (seven, capped) == (7.0, 20.0)
    assert 2.0 <= own <= 4.0
    assert date == pytest.approx(40.0 - 7.0 - 20.0 - own, abs=1.0) or date >= 4.0


@pytest.mark.parametrize("status", ["400 Bad", "401 No", "404 Not Found", "410 Gone", "499 Odd"])
async def test_what_is_refused_for_ever_is_kept_as_such_and_holds_up_nothing(
    status: str, room: Any
) -> None:
    server = await room.web(room.answers(status, body="no such\r\nplant"), room.answers("200 OK"))
    store = room.open_store()
    store.append([], [], [room.news(0), room.news(1)])
    sender = room.sender(server, store)

    async with room.running(sender):
        await room.settled(sender, store)

    (backlog,) = store.outbox.backlogs()
    assert [r.id for r in server.requests] == ["id-0", "id-1"]
    assert (backlog.n_waiting, backlog.n_dead) == (0, 1)
    assert backlog.last_dead is not None
    assert backlog.last_dead.answer == f"{status[:3]} no such plant"
    assert backlog.last_dead.state is LetterState.REFUSED


async def test_a_redirect_is_not_followed(room: Any) -> None:
    elsewhere = await room.web(room.answers("200 OK"))
    moved = room.answers("307 Temporary Redirect", f"Location: {elsewhere.url}")
    server, store = await room.web(moved, room.answers("200 OK")), room.open_store()
    store.append([], [], [room.news(0)])
    sender = room.sender(server, store)

    async with room.running(sender):
        await room.settled(sender, store)

    assert elsewhere.requests == []
    assert len(server.requests) == 2


async def test_a_thousand_events_reach_a_receiver_that_fails_at_random(room: Any) -> None:
    room.clock.held_from_s = 1e9
    chance, accepted = random.Random(5), []  # noqa: S311
    faults = [
        room.answers("500 Oh"),
        room.answers("429 Slow"),
        breaks_off,
        says_nothing,
        talks_nonsense,
    ]

    async def fails_at_random(request: Any, writer: asyncio.StreamWriter) -> None:
        if chance.random() < 0.3:
            await chance.choice(faults)(request, writer)
        else:
            accepted.append(request.id)
            await room.answers("200 OK")(request, writer)

    server, store = await room.web(fails_at_random), room.open_store()
    for first in range(0, 1000, 100):
        store.append([], [], [room.news(n) for n in range(first, first + 100)])
    sender = room.sender(server, store, max_age_s=1e8)

    async with room.running(sender):
        await room.settled(sender, store)

    assert accepted == [f"id-{n}" for n in range(1000)]
    assert len(server.requests) > 1000


async def test_what_grew_too_old_is_given_up_at_once_when_an_attempt_fails(room: Any) -> None:
    server, store = (
        await room.web(room.answers("503 Away"), room.answers("200 OK")),
        room.open_store(),
    )
    store.append([], [], [room.news(n) for n in range(5)])
    room.clock.ns += 3_610 * 10**9
    store.append([], [], [room.news(5)])
    sender = room.sender(server, store, max_age_s=3600.0)

    async with room.running(sender):
        await room.settled(sender, store)

    assert [r.id for r in server.requests] == ["id-0", "id-5"]
    (backlog,) = store.outbox.backlogs()
    assert backlog.n_dead == 5
    assert backlog.last_dead is not None
    assert backlog.last_dead.answer == "too old after: 503"


YEAR_S = 365.0 * 86_400.0


@pytest.mark.parametrize(
    ("queued_wrong_s", "sent_wrong_s"),
    [
        pytest.param(0.0, 20.0 * YEAR_S, id="set years ahead while it sends"),
        pytest.param(-50.0 * YEAR_S, 0.0, id="set right before it was started again"),
    ],
)
async def test_a_clock_that_is_set_gives_nothing_up(
    room: Any, queued_wrong_s: float, sent_wrong_s: float
) -> None:
    server = await room.web(room.answers("503 Away"), room.answers("200 OK"))
    store = room.open_store()
    room.clock.wrong_s = queued_wrong_s
    store.append([], [], [room.news(n) for n in range(3)])
    room.clock.wrong_s = 0.0
    sender = room.sender(server, store, max_age_s=3600.0)
    room.clock.wrong_s = sent_wrong_s

    async with room.running(sender):
        await room.settled(sender, store)

    assert [r.id for r in server.requests] == ["id-0", "id-0", "id-1", "id-2"]


async def test_quiet_hours_hold_what_is_no_danger_and_a_danger_ends_them_in_order(
    room: Any,
) -> None:
    server, store = await room.web(room.answers("200 OK")), room.open_store()
    store.append([], [], [room.news(0), room.news(1)])
    always = QuietHours(time(0, 0), time(23, 59), ZoneInfo("UTC"))
    sender = room.sender(server, store, quiet=always)

    async with room.running(sender):
        async with asyncio.timeout(30):
            while sender.status.state is not SenderState.QUIET:
                await asyncio.sleep(0)
        assert server.requests == []
        store.append([], [], [room.news(2, DANGER), room.news(3)])
        sender.wake()
        await server.until(3)
        async with asyncio.timeout(30):
            while sender.status.state is not SenderState.QUIET:
                await asyncio.sleep(0)

    assert [r.id for r in server.requests] == ["id-0", "id-1", "id-2"]
    assert [letter.event_id for letter in store.outbox.waiting("desk", 9)] == ["id-3"]


async def test_a_disk_that_refuses_to_note_a_delivery_never_makes_it_happen_twice(
    room: Any,
) -> None:
    server, store = await room.web(room.answers("200 OK")), room.open_store()
    store.append([], [], [room.news(0), room.news(1)])
    trigger = "CREATE TRIGGER refuse BEFORE UPDATE ON outbox BEGIN SELECT RAISE(ABORT, 'no'); END"
    store._writer.execute(trigger)
    sender = room.sender(server, store)

    async with room.running(sender):
        async with asyncio.timeout(30):
            while room.clock.slept_s.count(1.0) < 3:
                await asyncio.sleep(0)
        assert sender.status.state is SenderState.STORE_FAILS
        with store._writing() as writer:
            writer.execute("DROP TRIGGER refuse")
        await room.settled(sender, store)

    assert [r.id for r in server.requests] == ["id-0", "id-1"]
