"""A DAQ that is absent, silent or something else: the service runs, says so and keeps trying."""

import asyncio
import socket
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Any

from acquisition.daq.ring_device import RingDevice
from acquisition.daq.ring_server import ModbusRingServer

Start = Callable[..., Awaitable[Any]]
Feed = Callable[..., Any]

RATE_HZ = 600.0
N_CHANNELS = 12
N_SLOW = 5


def write_plant(path: Path, demo_file: Path, ports: dict[str, int]) -> Path:
    """Write a plant file: the demo's first unit once for each port."""
    head, unit = demo_file.read_text(encoding="utf-8").split("[[unit]]\n")[:2]
    units = [
        "[[unit]]\n" + unit.replace('"U1"', f'"{name}"').replace("port = 0", f"port = {port}")
        for name, port in ports.items()
    ]
    path.write_text(head.replace("var/demo", str(path.parent)) + "".join(units), encoding="utf-8")
    return path


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


def ring(counting_feed: Feed, n_channels: int = N_CHANNELS) -> ModbusRingServer:
    """A device that stands still: its header stays as a test leaves it."""
    return ModbusRingServer(RingDevice(counting_feed(n_channels, RATE_HZ, slow=(45.0,) * N_SLOW)))


async def test_each_wrong_daq_is_named_with_what_is_wrong_and_shows_no_number(
    start: Start, tmp_path: Path, demo_file: Path, counting_feed: Feed
) -> None:
    async with AsyncExitStack() as stack:
        nobody = stack.enter_context(socket.socket())
        nobody.bind(("127.0.0.1", 0))
        silent = await stack.enter_async_context(tcp_server(b""))
        web = await stack.enter_async_context(tcp_server(b"HTTP/1.1 400 Bad Request\r\n\r\n"))
        no_ring = await stack.enter_async_context(ring(counting_feed))
        no_ring.device.memory.write(0, b"\x12\x34")
        newer = await stack.enter_async_context(ring(counting_feed))
        newer.device.memory.write(1, b"\x00\x03")
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
        plant = write_plant(tmp_path / "plant.toml", demo_file, ports)
        program = await start("run", str(plant), "--port", "0")
        await program.wait_for_url()

        units = await program.until(
            "/api/v1/units",
            lambda units: all(u["source"]["state"] == "not_connected" for u in units),
        )

        reasons = {unit["id"]: unit["source"]["reason"] for unit in units}
        for name, said in {
            "absent": "Connection refused",
            "silent": "no answer within 0.5 s",
            "web": "wrong reply",
            "no_ring": "magic is 0x1234",
            "newer": "version is 3",
            "small": "n_channels is 8, expected 12",
            "standing": "its data stand still",
        }.items():
            assert said in reasons[name], reasons
            latest = await program.get(f"/api/v1/units/{name}/bearings/UJB/latest")
            assert latest["quality"] == {"level": "bad", "reason": "not_connected"}
            assert {reading["value"] for reading in latest["readings"].values()} == {None}
        for name, port in ports.items():
            assert f"127.0.0.1:{port}" in reasons[name]
        assert (await program.get("/readyz"))["status"] == "ok"
        assert await program.end() == 0
    assert "Traceback" not in program.errors


async def test_a_daq_that_comes_up_later_is_found(
    start: Start, tmp_path: Path, demo_file: Path
) -> None:
    # bound but not listening: the port is refused, and nobody else can be given it
    with socket.socket() as reserved:
        reserved.bind(("127.0.0.1", 0))
        port = reserved.getsockname()[1]
        plant = write_plant(tmp_path / "plant.toml", demo_file, {"U1": port})
        program = await start("run", str(plant), "--port", "0")
        await program.wait_for_url()
        refused = await program.until(
            "/api/v1/units/U1", lambda unit: unit["source"]["state"] == "not_connected"
        )
        assert f"{port}" in refused["source"]["reason"]
        assert refused["source"]["data_age_s"] is None
        reserved.close()

        daq = await start("daq", str(plant))
        found = await program.until(
            "/api/v1/units/U1", lambda unit: unit["source"]["state"] == "connected"
        )

    assert found["source"]["reason"] is None
    assert found["source"]["n_gap"] == 0
    assert await program.end() == 0
    assert await daq.end() == 0
