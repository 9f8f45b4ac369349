"""`padwatch delivery test|retry`."""

import asyncio
import hashlib
import hmac
import json
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
from rigs.command_line import padwatch, padwatch_program

RECEIVER = """
[delivery]
dashboard_url = "https://padwatch.example/"
[[delivery.receiver]]
kind = "webhook"
id = "desk"
url = "http://127.0.0.1:{port}/"
secret = {{ file = "{secret}" }}
"""


@pytest.fixture
async def desk(plant_path: Path) -> AsyncIterator[dict[str, Any]]:
    """A web server with the plant file that names it; answers what it is told to."""
    found: dict[str, Any] = {"answer": "200 OK", "requests": [], "plant": plant_path}

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        head = (await reader.readuntil(b"\r\n\r\n")).decode().lower().split("\r\n")
        headers = dict(line.split(": ", 1) for line in head[1:-2])
        body = await reader.readexactly(int(headers["content-length"]))
        found["requests"].append((headers, body))
        writer.write(f"HTTP/1.1 {found['answer']}\r\n\r\n".encode())
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    secret = plant_path.with_name("secret")
    secret.write_text("s3cret\n")
    receiver = RECEIVER.format(port=server.sockets[0].getsockname()[1], secret=secret)
    plant_path.write_text(plant_path.read_text(encoding="utf-8") + receiver, encoding="utf-8")
    yield found
    server.close()
    await server.wait_closed()


async def test_a_test_message_arrives_signed_and_says_that_it_is_one(desk: dict[str, Any]) -> None:
    done = await asyncio.to_thread(padwatch_program, "delivery", "test", desk["plant"], "desk")

    assert done == (0, "desk: delivered: 200\n", "")
    ((headers, body),) = desk["requests"]
    message = json.loads(body)
    assert (message["type"], message["plant"]) == ("test", "Demo plant")
    assert message["url"] == "https://padwatch.example/#/alarms"
    signed = headers["padwatch-timestamp"].encode() + b"." + body
    signature = hmac.new(b"s3cret", signed, hashlib.sha256).hexdigest()
    assert headers["padwatch-signature"] == f"v1={signature}"


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
        ("test", "office", 2, "unknown receiver office; known receivers: desk"),
        ("retry", "desk", 1, "the database does not exist"),
    ],
)
async def test_what_needs_a_receiver_or_a_database_is_refused_without(
    desk: dict[str, Any], command: str, receiver: str, code: int, said: str
) -> None:
    done = await asyncio.to_thread(padwatch, "delivery", command, desk["plant"], receiver)

    assert done.exit_code == code
    assert said in done.stderr
