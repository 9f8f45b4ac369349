"""`padwatch delivery test|retry`."""

import asyncio
import json
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
from rigs.command_line import padwatch, padwatch_program

RECEIVER = """
[[delivery.receiver]]
kind = "webhook"
id = "desk"
url = "http://127.0.0.1:{port}/"
"""


@pytest.fixture
async def desk(plant_path: Path) -> AsyncIterator[dict[str, Any]]:
    """A web server with the plant file that names it; answers what it is told to."""
    found: dict[str, Any] = {"answer": "200 OK", "bodies": [], "plant": plant_path}

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        head = (await reader.readuntil(b"\r\n\r\n")).decode().lower()
        length = int(head.split("content-length: ")[1].split("\r\n")[0])
        found["bodies"].append(json.loads(await reader.readexactly(length)))
        writer.write(f"HTTP/1.1 {found['answer']}\r\n\r\n".encode())
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    receiver = RECEIVER.format(port=server.sockets[0].getsockname()[1])
    plant_path.write_text(plant_path.read_text(encoding="utf-8") + receiver, encoding="utf-8")
    yield found
    server.close()
    await server.wait_closed()


async def test_a_test_message_arrives_and_says_that_it_is_one(desk: dict[str, Any]) -> None:
    done = await asyncio.to_thread(padwatch_program, "delivery", "test", desk["plant"], "desk")

    assert done == (0, "desk: delivered: 200\n", "")
    (body,) = desk["bodies"]
    assert (body["type"], body["plant"]) == ("test", "Demo plant")


@pytest.mark.parametrize(
    ("answer", "outcome"), [("401 No", "refused"), ("503 Away", "not delivered")]
)
async def test_a_test_message_that_is_not_taken_says_why(
    answer: str, outcome: str, desk: dict[str, Any]
) -> None:
    desk["answer"] = answer
    command = ("delivery", "test", desk["plant"], "desk", "--json")
    done = await asyncio.to_thread(padwatch, *command)

    assert done.exit_code == 1
    (found,) = json.loads(done.stdout)
    assert (found["outcome"], found["answer"]) == (outcome, answer[:3])


@pytest.mark.parametrize(
    ("command", "receiver", "code", "said"),
    [
        ("test", "office", 2, "there is no receiver office; the plant file has desk"),
        ("retry", "desk", 1, "there is no such database"),
    ],
)
async def test_what_needs_a_receiver_or_a_database_is_refused_without(
    desk: dict[str, Any], command: str, receiver: str, code: int, said: str
) -> None:
    done = await asyncio.to_thread(padwatch, "delivery", command, desk["plant"], receiver)

    assert done.exit_code == code
    assert said in done.stderr
