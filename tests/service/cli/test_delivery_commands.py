"""`padwatch delivery` as a process."""

import asyncio
import json
import sys
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[3]

RECEIVER = """
[[delivery.receiver]]
kind = "webhook"
id = "desk"
url = "http://127.0.0.1:{port}/"
"""


async def padwatch(*arguments: object) -> tuple[int, str, str]:
    program = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "service.cli.main", "delivery", *map(str, arguments)),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        env={"PYTHONPATH": str(ROOT), "PATH": ""},
    )
    said, complained = await program.communicate()
    return program.returncode or 0, said.decode(), complained.decode()


@pytest.fixture
async def desk(plant_text: str, tmp_path: Path) -> AsyncIterator[dict[str, Any]]:
    """A web server with the plant file that names it; answers what it is told to."""
    found: dict[str, Any] = {"answer": "200 OK", "bodies": [], "plant": tmp_path / "plant.toml"}

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        head = (await reader.readuntil(b"\r\n\r\n")).decode().lower()
        length = int(head.split("content-length: ")[1].split("\r\n")[0])
        found["bodies"].append(json.loads(await reader.readexactly(length)))
        writer.write(f"HTTP/1.1 {found['answer']}\r\n\r\n".encode())
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    receiver = RECEIVER.format(port=server.sockets[0].getsockname()[1])
    text = plant_text.replace("var/demo", str(tmp_path / "data")) + receiver
    found["plant"].write_text(text, encoding="utf-8")
    yield found
    server.close()
    await server.wait_closed()


async def test_a_test_message_arrives_and_says_that_it_is_one(desk: dict[str, Any]) -> None:
    code, said, complained = await padwatch("test", desk["plant"], "desk")

    assert (code, said, complained) == (0, "desk: delivered: 200\n", "")
    (body,) = desk["bodies"]
    assert (body["type"], body["plant"]) == ("test", "Demo plant")


@pytest.mark.parametrize(
    ("answer", "outcome"), [("401 No", "refused"), ("503 Away", "not delivered")]
)
async def test_a_test_message_that_is_not_taken_says_why(
    answer: str, outcome: str, desk: dict[str, Any]
) -> None:
    desk["answer"] = answer
    code, said, _ = await padwatch("test", desk["plant"], "desk", "--json")

    assert code == 1
    (found,) = json.loads(said)
    assert (found["outcome"], found["answer"]) == (outcome, answer[:3])


async def test_a_receiver_that_there_is_not_is_refused(desk: dict[str, Any]) -> None:
    code, _, complained = await padwatch("test", desk["plant"], "office")

    assert code == 2
    assert "there is no receiver office; the plant file has desk" in complained


async def test_a_new_try_needs_a_database(desk: dict[str, Any]) -> None:
    code, _, complained = await padwatch("retry", desk["plant"], "desk")

    assert code == 1
    assert "there is no such database" in complained
