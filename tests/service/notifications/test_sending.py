"""From the outbox to a web server that does all that web servers do; waits; secrets."""

import asyncio
import json
import random
from typing import Any

import pytest
from harness.waiting import until
from hypothesis import given
from hypothesis import strategies as st
from rigs.tiers import first_fast

from core.limits import AlarmLevel, Judgement
from service.live.receivers import SenderState
from service.notifications.channel import Failed, SecretError, read_secret
from service.notifications.sender import wait_s
from service.settings.notifications import SecretSettings
from service.store.outbox import MessageState

DANGER = Judgement(AlarmLevel.DANGER, value=260.0, limit=250.0, reason="above_limit")


async def test_news_is_told_as_soon_as_the_sender_is_woken(room):
    server, store = await room.web(room.answers("200 OK")), room.open_store()
    sender = room.sender(server, store)

    async with room.running(sender):
        for n in range(3):
            store.append([], [], [room.news(n)])
            sender.wake()
            await server.until(n + 1)

    assert [r.id for r in server.requests] == ["id-0", "id-1", "id-2"]


def says(words: bytes, for_ever: bytes = b"") -> Any:
    """A web server that sends some bytes, and perhaps others for ever, whatever it is asked."""

    async def behave(_: object, writer: asyncio.StreamWriter) -> None:
        writer.write(words)
        while for_ever:
            writer.write(for_ever)
            await writer.drain()

    return behave


BROKEN_OFF = says(b"HTTP/1.1 20")
NO_ANSWER = says(b"")
NONSENSE = says(b"220 mail.example ESMTP\r\n\r\n" * 10)
INTERIM_FOR_EVER = says(b"", b"HTTP/1.1 100 Continue\r\n\r\n" * 1000)
ENDLESS_HEADERS = says(b"HTTP/1.1 200 OK\r\n", b"X-More: " + b"x" * 1000 + b"\r\n")


@pytest.mark.parametrize(
    "fault",
    [
        "500 Internal Server Error",
        "503 Service Unavailable",
        "408 Request Timeout",
        "425 Too Early",
        "429 Too Many Requests",
        "301 Moved Permanently",
        "307 Temporary Redirect",
        "101 Switching",
        pytest.param(BROKEN_OFF, id="broken off"),
        pytest.param(NO_ANSWER, id="no answer"),
        pytest.param(NONSENSE, id="nonsense"),
        pytest.param(ENDLESS_HEADERS, id="endless headers"),
        pytest.param(INTERIM_FOR_EVER, id="interim answers"),
    ],
)
async def test_what_may_pass_is_tried_again_with_the_same_message_before_any_later_one(fault, room):
    elsewhere = await room.web(room.answers("200 OK"))
    location = f"Location: {elsewhere.url}"  # a redirect is not followed
    faulty = room.answers(fault, location) if isinstance(fault, str) else fault
    server = await room.web(faulty, faulty, faulty, room.answers("200 OK"))
    store = room.open_store()
    store.append([], [], [room.news(0), room.news(1)])

    await room.delivered(server, store)

    assert [r.id for r in server.requests] == ["id-0"] * 4 + ["id-1"]
    assert len({r.body for r in server.requests[:4]}) == 1
    first, second, third = room.clock.slept_s[:3]
    assert 0.5 <= first <= 1.0 <= second <= 2.0 <= third <= 4.0
    assert [n for _, _, n, _ in room.letters(store)] == [4, 1]
    assert elsewhere.requests == []


async def test_a_receiver_that_asks_for_time_gets_it_up_to_the_limit(room):
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

    await room.delivered(server, store, max_retry_s=20.0)

    seven, capped, own, date = room.clock.slept_s[:4]
    assert (seven, capped) == (7.0, 20.0)
    assert 2.0 <= own <= 4.0
    assert date == pytest.approx(40.0 - 7.0 - 20.0 - own, abs=1.0) or date >= 4.0


@pytest.mark.parametrize("status", ["400 Bad", "401 No", "404 Not Found", "410 Gone", "499 Odd"])
async def test_what_is_refused_for_ever_is_kept_as_such_and_holds_up_nothing(status, room):
    server = await room.web(room.answers(status, body="no such\r\nplant"), room.answers("200 OK"))
    store = room.open_store()
    store.append([], [], [room.news(0), room.news(1)])

    await room.delivered(server, store)

    (backlog,) = store.outbox.backlogs().values()
    assert [r.id for r in server.requests] == ["id-0", "id-1"]
    assert (backlog.n_waiting, backlog.n_dead) == (0, 1)
    assert backlog.last_dead is not None
    assert backlog.last_dead.reason == f"{status[:3]} no such plant"
    assert backlog.last_dead.outcome is MessageState.REFUSED


@pytest.mark.parametrize("n_events", first_fast(1, [100, 1000]))
async def test_each_event_reaches_a_receiver_that_fails_at_random_once_and_in_order(room, n_events):
    room.clock.held_from_s = 1e9
    chance, accepted = random.Random(5), []  # noqa: S311
    refusals = [room.answers("500 Oh"), room.answers("429 Slow")]
    faults = [*refusals, BROKEN_OFF, NO_ANSWER, NONSENSE]

    async def fails_at_random(request: Any, writer: asyncio.StreamWriter) -> None:
        if chance.random() < 0.3:
            await chance.choice(faults)(request, writer)
        else:
            accepted.append((request.id, json.loads(request.body)["subject"]))
            await room.answers("200 OK")(request, writer)

    server, store = await room.web(fails_at_random), room.open_store()
    store.append([], [], [room.news(n) for n in range(n_events)])

    await room.delivered(server, store, max_age_h=8760.0)

    assert accepted == [(f"id-{n}", f"B{n}") for n in range(n_events)]
    assert {state for _, state, *_ in room.letters(store)} == {"delivered"}
    assert len(server.requests) > n_events


async def test_what_grew_too_old_is_given_up_at_once_when_an_attempt_fails(room):
    server = await room.web(room.answers("503 Away"), room.answers("200 OK"))
    store = room.open_store()
    store.append([], [], [room.news(n) for n in range(5)])
    room.clock.step(3_610 * 10**9)
    store.append([], [], [room.news(5)])

    await room.delivered(server, store, max_age_h=1.0)

    assert [r.id for r in server.requests] == ["id-0", "id-5"]
    (backlog,) = store.outbox.backlogs().values()
    assert backlog.n_dead == 5
    assert backlog.last_dead is not None
    assert backlog.last_dead.reason == "expired after the last failure: 503"


YEAR_NS = 365 * 86_400 * 10**9


@pytest.mark.parametrize(
    ("queued_wrong_ns", "sent_wrong_ns"),
    [
        pytest.param(0, 20 * YEAR_NS, id="set years ahead while it sends"),
        pytest.param(-50 * YEAR_NS, 0, id="set right before it was started again"),
    ],
)
async def test_a_clock_that_is_set_gives_nothing_up(room, queued_wrong_ns, sent_wrong_ns):
    server = await room.web(room.answers("503 Away"), room.answers("200 OK"))
    store = room.open_store()
    right_ns = room.clock.ns
    room.clock.ns = right_ns + queued_wrong_ns
    store.append([], [], [room.news(n) for n in range(3)])
    room.clock.ns = right_ns
    sender = room.sender(server, store, max_age_h=1.0)
    room.clock.ns = right_ns + sent_wrong_ns

    async with room.running(sender):
        await room.settled(sender, store)

    assert [r.id for r in server.requests] == ["id-0", "id-0", "id-1", "id-2"]


async def until_quiet(sender: Any) -> None:
    await until(lambda: sender.status.state is SenderState.QUIET)


async def test_quiet_hours_hold_what_is_no_danger_and_a_danger_ends_them_in_order(room):
    server, store = await room.web(room.answers("200 OK")), room.open_store()
    store.append([], [], [room.news(0), room.news(1)])
    always = {"start": "00:00", "end": "23:59", "time_zone": "UTC"}
    sender = room.sender(server, store, quiet=always)

    async with room.running(sender):
        await until_quiet(sender)
        assert server.requests == []
        store.append([], [], [room.news(2, DANGER), room.news(3)])
        sender.wake()
        await server.until(3)
        await until_quiet(sender)

    assert [r.id for r in server.requests] == ["id-0", "id-1", "id-2"]
    assert [letter.event_id for letter in store.outbox.waiting("desk", 9)] == ["id-3"]


async def test_a_disk_that_refuses_to_note_a_delivery_never_makes_it_happen_twice(room):
    server, store = await room.web(room.answers("200 OK")), room.open_store()
    store.append([], [], [room.news(0), room.news(1)])
    trigger = "CREATE TRIGGER refuse BEFORE UPDATE ON outbox BEGIN SELECT RAISE(ABORT, 'no'); END"
    store._writer.execute(trigger)
    sender = room.sender(server, store)

    async with room.running(sender):
        await until(lambda: room.clock.slept_s.count(1.0) >= 3)
        assert sender.status.state is SenderState.STORE_FAILS
        with store._writing() as writer:
            writer.execute("DROP TRIGGER refuse")
        await room.settled(sender, store)

    assert [r.id for r in server.requests] == ["id-0", "id-1"]


TALKATIVE = says(b"HTTP/1.1 200 OK\r\n\r\n", b"thank you " * 1000)
REFUSES_AT_LENGTH = says(
    b"HTTP/1.1 410 Gone\r\nContent-Encoding: gzip\r\n\r\n", b"never again " * 1000
)


@pytest.mark.parametrize(
    ("behave", "state"),
    [(TALKATIVE, "delivered"), (REFUSES_AT_LENGTH, "refused")],
    ids=["delivered", "refused"],
)
async def test_the_status_counts_and_of_an_endless_answer_no_more_is_read_than_is_shown(
    behave, state, room
):
    server, store = await room.web(behave), room.open_store()
    store.append([], [], [room.news(0)])

    await room.delivered(server, store)

    ((_, found, n_attempts, answer),) = room.letters(store)
    assert (found, n_attempts) == (state, 1)
    assert len(answer) <= 200


async def hangs(*_: object) -> None:
    await asyncio.Event().wait()


async def dribbles(_: object, writer: asyncio.StreamWriter) -> None:
    while True:
        writer.write(b"H")
        await writer.drain()
        await asyncio.sleep(0.001)


@pytest.mark.parametrize("behave", [hangs, dribbles])
async def test_a_receiver_that_never_answers_delays_neither_another_one_nor_the_end(behave, room):
    slow, quick = await room.web(behave), await room.web(room.answers("200 OK"))
    store = room.open_store(room.routed("slow"), room.routed("quick"))
    store.append([], [], [room.news(n) for n in range(30)])
    senders = room.sender(slow, store, "slow"), room.sender(quick, store, "quick")

    async with room.running(*senders):
        await slow.until(1)
        await room.settled(senders[1], store)
        assert senders[0].status.state is SenderState.SENDING

    assert len(quick.requests) == 30
    assert len(store.outbox.waiting("slow", 100)) == 30


@pytest.mark.parametrize("behave", [INTERIM_FOR_EVER, ENDLESS_HEADERS], ids=["interim", "headers"])
async def test_a_flood_is_left_after_some_bytes_and_not_after_some_time(behave, room):
    server = await room.web(behave)
    sender = room.sender(server, room.open_store())

    outcome = await sender.receiver.channel.send({"id": "1"}, "{}")

    assert outcome == Failed("the response is longer than 32768 bytes")


SHARES = st.floats(0.0, 1.0)
LONGEST_S = st.floats(1.0, 86_400.0)


@given(n=st.integers(1, 10**6), share=SHARES, longest_s=LONGEST_S, asked_s=st.floats(0.0, 1e12))
def test_a_wait_is_at_least_half_a_second_and_at_most_its_limit(n, share, longest_s, asked_s):
    waited_s = wait_s(n, asked_s, longest_s, lambda: share)

    assert 0.5 <= waited_s <= longest_s
    assert waited_s >= min(asked_s, longest_s)


@given(n=st.integers(1, 20), share=SHARES)
def test_no_wait_is_shorter_than_one_before_it_could_have_been(n, share):
    assert wait_s(n + 1, None, 1e9, lambda: 1.0) >= wait_s(n, None, 1e9, lambda: share) * 0.999


def test_a_secret_loses_the_end_of_its_line_and_nothing_else(tmp_path):
    (tmp_path / "key").write_text("s3cret with spaces\r\n")

    assert read_secret(SecretSettings(file=str(tmp_path / "key"))) == "s3cret with spaces"


@pytest.mark.parametrize("content", [None, b"", b"\n", b"a\nb", b"\xff\xfe", b"a\x00b"])
def test_what_is_no_line_of_text_is_refused_without_being_shown(content, tmp_path):
    if content is not None:
        (tmp_path / "key").write_bytes(content)

    with pytest.raises(SecretError, match="No such file" if content is None else None) as refusal:
        read_secret(SecretSettings(file=str(tmp_path / "key")))
    assert str(tmp_path / "key") in str(refusal.value)
