"""The socket between measuring and serving: whatever one end does, the other notices."""

import asyncio
import json
import socket
import struct
from collections.abc import Callable
from typing import Any

import pytest

from service.live import exchange
from service.live.exchange import MeasuringEnd, MeasuringGoneError, Question, ServingEnd

Report = Callable[[bool], object]


async def echo(question: Question) -> object:
    if question.kind == "faulty":
        raise LookupError("no such thing")
    return json.loads(question.document), question.actor, question.peer


async def connected(report: Report) -> tuple[asyncio.Task[None], Any, Any]:
    """A measuring end that runs, and reader and writer of the other end."""
    ours, theirs = socket.socketpair()
    end = MeasuringEnd(report, echo, period_s=0.01)
    serving = asyncio.create_task(end.serve(*await asyncio.open_connection(sock=ours)))
    return serving, *await asyncio.open_connection(sock=theirs)


async def test_the_first_report_is_whole_and_answers_go_to_those_who_asked():
    taken: list[bool] = []

    async def take(report: bool) -> None:
        taken.append(report)

    serving, reader, writer = await connected(lambda is_first: is_first)
    end = ServingEnd(writer)
    running = asyncio.create_task(end.run(reader, take))

    asked = [end.ask("echo", json.dumps(n), "A. Name", "192.0.2.7") for n in range(50)]

    assert await asyncio.gather(*asked) == [(n, "A. Name", "192.0.2.7") for n in range(50)]
    with pytest.raises(MeasuringGoneError, match="no such thing"):
        await end.ask("faulty", "[]")
    while len(taken) < 3:
        await asyncio.sleep(0)
    assert taken[:3] == [True, False, False]
    writer.close()
    await asyncio.wait([serving, running])
    assert serving.exception() is None


async def test_a_question_is_not_left_waiting_when_the_measuring_process_ends():
    ours, theirs = socket.socketpair()
    reader, writer = await asyncio.open_connection(sock=theirs)
    end = ServingEnd(writer)
    running = asyncio.create_task(end.run(reader, lambda _: asyncio.sleep(0)))
    asked = asyncio.create_task(end.ask("echo", "[]"))
    await asyncio.sleep(0)

    ours.close()

    with pytest.raises(MeasuringGoneError, match="has ended"):
        await asked
    await running
    with pytest.raises(MeasuringGoneError, match="has ended"):
        await end.ask("echo", "[]")


async def test_a_serving_process_that_reads_nothing_is_given_up(monkeypatch):
    monkeypatch.setattr(exchange, "TAKEN_WITHIN_S", 0.05)
    serving, _, writer = await connected(lambda _: bytes(1_000_000))
    await serving
    writer.close()


@pytest.mark.parametrize("n_bytes", [1, 1_000_000])
async def test_a_serving_process_that_ends_is_no_fault_of_the_measuring_process(n_bytes):
    serving, reader, writer = await connected(lambda _: bytes(n_bytes))
    await reader.readexactly(4)

    writer.transport.abort()

    await serving


async def test_a_report_that_cannot_be_built_is_not_kept_secret():
    serving, _, writer = await connected(lambda _: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        await serving
    writer.close()


@pytest.mark.parametrize(
    "message",
    [
        struct.pack(">I", 1_000_001),
        struct.pack(">I", 2) + b"[]",
        struct.pack(">I", 5) + b"\x80\x05\x8c\x01a",
        struct.pack(">I", 2) + b"[",
        b"\0",
    ],
    ids=["too long", "no question", "pickled", "cut off", "half a length"],
)
async def test_a_message_that_is_no_question_ends_the_connection_and_nothing_else(message):
    serving, reader, writer = await connected(bool)
    writer.write(message)
    writer.write_eof()

    await reader.read()  # up to the end
    await serving
    writer.close()
