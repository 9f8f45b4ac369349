"""The real service stops when it is told to, and serves, whatever its clients do."""

import asyncio
import signal
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

Start = Callable[..., Awaitable[Any]]

HANGING = (
    b"",
    b"GET / HTTP/1.1\r\nHost: localhost\r\nX-Slow: ",
    b"POST /api/v1/alarms HTTP/1.1\r\nHost: localhost\r\nContent-Length: 60000\r\n\r\n[",
    b"GET /static/plotly.min.js HTTP/1.1\r\nHost: localhost\r\n\r\n" * 8,
    b"GET /livez HTTP/1.1\r\nHost: localhost\r\n\r\n",
    b"GET /api/v1/units/U1/bearings/UJB/film/readings?format=parquet HTTP/1.1\r\n"
    b"Host: localhost\r\n\r\n",
)
"""Silent, never ending their headers or their body, never reading megabytes, idle after an answer,
not reading a table."""


async def test_the_service_serves_and_stops_among_hanging_clients(
    start: Start, tmp_path: Path, write_plant: Callable[..., Path]
) -> None:
    service = await start("run", str(write_plant(tmp_path)), "--port", "0")
    url = await service.wait_for_url()
    host, _, port = url.removeprefix("http://").partition(":")
    async with AsyncExitStack() as stack:
        for n in range(120):
            _, writer = await asyncio.open_connection(host, int(port), limit=1024)
            stack.callback(writer.close)
            writer.write(HANGING[n % len(HANGING)])
        assert (await service.get("/livez"))["status"] == "ok"

        assert await service.end(signal.SIGTERM) == 0

    assert "Traceback" not in service.errors
