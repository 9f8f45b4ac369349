"""A lost link is told to a web server that hangs, over a restart, by the whole program."""

import asyncio
import hashlib
import hmac
import json
from collections.abc import Callable
from pathlib import Path

from .conftest import PATIENCE_S, Start

SETTINGS = """
[alarms]
link_lost_after_s = 1.0

[delivery]
dashboard_url = "https://padwatch.example/"

[[delivery.receiver]]
kind = "webhook"
id = "desk"
url = "http://127.0.0.1:{port}/alarms"
secret = {{ file = "{secret}" }}
kinds = ["link_lost"]
units = ["U1"]
"""


class Desk:
    """Takes alarms, or lets them wait for an answer."""

    def __init__(self) -> None:
        self.requests: list[tuple[dict[str, str], bytes]] = []
        self.hangs = True
        self.came = asyncio.Condition()

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        head = (await reader.readuntil(b"\r\n\r\n")).decode().split("\r\n")
        headers = dict(line.lower().split(": ", 1) for line in head[1:-2])
        body = await reader.readexactly(int(headers["content-length"]))
        async with self.came:
            self.requests.append((headers, body))
            self.came.notify_all()
        if self.hangs:
            await reader.read()  # until the other side has gone
        else:
            writer.write(b"HTTP/1.1 204 No Content\r\n\r\n")
            await writer.drain()
        writer.close()

    async def until(self, n_requests: int) -> None:
        async with asyncio.timeout(PATIENCE_S), self.came:
            await self.came.wait_for(lambda: len(self.requests) >= n_requests)


async def test_a_lost_link_is_told_across_a_restart_and_a_hanging_server_holds_up_nothing(
    start: Start, tmp_path: Path, write_plant: Callable[..., Path]
) -> None:
    desk, secret = Desk(), tmp_path / "secret"
    secret.write_text("s3cret\n")
    server = await asyncio.start_server(desk.serve, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    plant = write_plant(tmp_path, tables=SETTINGS.format(port=port, secret=secret))

    program = await start("run", str(plant), "--port", "0")
    await program.wait_for_url()
    await desk.until(1)
    found = await program.until("/api/v1/delivery", lambda said: said["n_waiting"] == 1)
    assert found["receivers"][0]["state"] == "sending"
    assert found["receivers"][0]["address"] == f"http://127.0.0.1:{port}"
    assert await program.end() == 0
    assert "Traceback" not in program.errors

    desk.hangs = False
    program = await start("run", str(plant), "--port", "0")
    await program.wait_for_url()
    await program.until("/api/v1/delivery", lambda said: said["receivers"][0]["last_delivered"])
    assert await program.end() == 0
    server.close()
    await server.wait_closed()

    (first, body), (again, same) = desk.requests[:2]
    assert first["padwatch-event-id"] == again["padwatch-event-id"]
    assert body == same
    signed = again["padwatch-timestamp"].encode() + b"." + same
    signature = hmac.new(b"s3cret", signed, hashlib.sha256).hexdigest()
    assert again["padwatch-signature"] == f"v1={signature}"
    message = json.loads(body)
    assert message["alarm"] == "U1:link:link_lost"
    assert (message["change"], message["is_active"]) == ("raised", True)
    assert message["url"] == "https://padwatch.example/#/alarms"
