"""A DAQ that is absent, silent or something else: the service runs, says so and keeps trying."""

import asyncio
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Any

from acquisition.clock import SystemClock
from acquisition.simulated.devices.modbus_links import ModbusTcpServer
from acquisition.simulated.devices.ring_device import RingDevice

from .conftest import WIRE, Start

Feed = Callable[..., Any]

RATE_HZ = 600.0
N_CHANNELS = 12
N_SLOW = 5

EXPECTED = {
    "absent": "Connection refused",
    "silent": "no answer within 5.0 s",
    "web": "wrong reply",
    "no_ring": "magic is 0x1234",
    "newer": "version is 3",
    "small": "n_channels is 8, expected 12",
    "standing": "its data stand still",
}
"""Why each DAQ is not connected."""


@asynccontextmanager
async def tcp_server(reply: bytes) -> AsyncIterator[int]:
    """Something that accepts connections, answers every request the same, or never."""
    writers: list[asyncio.StreamWriter] = []

    async def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writers.append(writer)
        while await reader.read(1000):
            writer.write(reply)

    server = await asyncio.start_server(accept, "127.0.0.1", 0)
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        server.close()
        for writer in writers:
            writer.close()
        await server.wait_closed()


def ring(
    counting_feed: Feed, n_channels: int = N_CHANNELS, header: bytes = b"", **server: Any
) -> ModbusTcpServer:
    """A device that stands still: its header stays as a test leaves it, if it is changed."""
    device = RingDevice(counting_feed(n_channels, RATE_HZ, slow=(45.0,) * N_SLOW))
    device.memory.write(0, header)
    return ModbusTcpServer(device, **server)


async def test_each_wrong_daq_is_named_and_shows_no_number_and_one_that_comes_up_is_found(
    start: Start, tmp_path: Path, write_plant: Feed, counting_feed: Feed
) -> None:
    async with AsyncExitStack() as stack:
        # bound but not listening: the port is refused, and nobody else can be given it
        nobody = stack.enter_context(socket.socket())
        nobody.bind(("127.0.0.1", 0))
        silent = await stack.enter_async_context(tcp_server(b""))
        web = await stack.enter_async_context(tcp_server(b"HTTP/1.1 400 Bad Request\r\n\r\n"))
        no_ring = await stack.enter_async_context(ring(counting_feed, header=b"\x12\x34"))
        newer = await stack.enter_async_context(ring(counting_feed, header=b"\x50\x57\x00\x03"))
        small = await stack.enter_async_context(ring(counting_feed, n_channels=8))
        standing = await stack.enter_async_context(ring(counting_feed))
        ports = {
            "absent": nobody.getsockname()[1],
            "silent": silent,
            "web": web,
            "no_ring": no_ring.port,
            "newer": newer.port,
            "small": small.port,
            "standing": standing.port,
        }
        source = f"{WIRE}timeout_s = 5.0\n"
        plant = write_plant(tmp_path, ports, source=source)
        program = await start("run", str(plant), "--port", "0")
        await program.wait_for_url()

        def are_named(units: list[dict[str, Any]]) -> bool:
            told = {unit["id"]: unit["source"]["reason"] or "" for unit in units}
            return all(words in told[name] for name, words in EXPECTED.items())

        units = await program.until("/api/v1/units", are_named)

        assert {unit["source"]["state"] for unit in units} == {"not_connected"}
        assert units[0]["source"]["data_age_s"] is None
        reasons = {unit["id"]: unit["source"]["reason"] for unit in units}
        for name in EXPECTED:
            latest = await program.get(f"/api/v1/units/{name}/bearings/UJB/latest")
            assert latest["quality"] == {"level": "bad", "reason": "not_connected"}
            assert {reading["value"] for reading in latest["readings"].values()} == {None}
        for name, port in ports.items():
            assert f"127.0.0.1:{port}" in reasons[name]
        assert (await program.get("/readyz"))["status"] == "ok"

        nobody.close()
        late = ring(counting_feed, clock=SystemClock(), port=ports["absent"])
        running = asyncio.create_task((await stack.enter_async_context(late)).run())
        stack.callback(running.cancel)
        found = await program.until(
            "/api/v1/units/absent", lambda unit: unit["source"]["state"] == "connected"
        )
        assert (found["source"]["reason"], found["source"]["n_gap"]) == (None, 0)
        assert await program.end() == 0
    assert "Traceback" not in program.errors
