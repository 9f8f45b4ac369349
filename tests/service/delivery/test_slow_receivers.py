"""Receivers that answer for ever, or not at all."""

import asyncio
from typing import Any

import pytest

from service.delivery.outcome import Failed
from service.delivery.sender import SenderState
from service.store.sqlite import SqliteStore


def events(store: SqliteStore) -> list[tuple[str, str, int, str]]:
    """Every letter there ever was: event, state, attempts in vain and answers, by number."""
    with store._reader() as reader:
        found = reader.execute("SELECT event_id, state, n_attempts, answer FROM outbox ORDER BY id")
        return found.fetchall()


async def never_stops_talking(_: object, writer: asyncio.StreamWriter) -> None:
    writer.write(b"HTTP/1.1 200 OK\r\n\r\n")
    while True:
        writer.write(b"thank you " * 1000)
        await writer.drain()


async def refuses_at_length(_: object, writer: asyncio.StreamWriter) -> None:
    writer.write(b"HTTP/1.1 410 Gone\r\nContent-Encoding: gzip\r\n\r\n")
    while True:
        writer.write(b"never again " * 1000)
        await writer.drain()


@pytest.mark.parametrize(
    ("behave", "state"), [(never_stops_talking, "delivered"), (refuses_at_length, "refused")]
)
async def test_the_status_counts_and_of_an_endless_answer_no_more_is_read_than_is_shown(
    behave: Any, state: str, room: Any
) -> None:
    server, store = await room.web(behave), room.open_store()
    store.append([], [], [room.news(0)])
    sender = room.sender(server, store)

    async with room.running(sender):
        await room.settled(sender, store)

    ((_, found, n_attempts, answer),) = events(store)
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
async def test_a_receiver_that_never_answers_delays_neither_another_one_nor_the_end(
    behave: Any, room: Any
) -> None:
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


async def floods_with_interim_answers(_: object, writer: asyncio.StreamWriter) -> None:
    while True:
        writer.write(b"HTTP/1.1 100 Continue\r\n\r\n" * 1000)
        await writer.drain()


async def floods_with_headers(_: object, writer: asyncio.StreamWriter) -> None:
    writer.write(b"HTTP/1.1 200 OK\r\n")
    while True:
        writer.write(b"X: y\r\n" * 1000)
        await writer.drain()


@pytest.mark.parametrize("behave", [floods_with_interim_answers, floods_with_headers])
async def test_a_flood_is_left_after_some_bytes_and_not_after_some_time(
    behave: Any, room: Any
) -> None:
    server = await room.web(behave)
    sender = room.sender(server, room.open_store())

    outcome = await sender.receiver.carrier.carry({"id": "1"}, "{}")

    assert outcome == Failed("the answer is longer than 32768 bytes")
