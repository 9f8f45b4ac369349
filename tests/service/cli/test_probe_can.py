"""`padwatch probe can` as its users see it."""

import asyncio
import json
from collections.abc import AsyncIterator

import pytest
import typer
from typer.testing import CliRunner

from acquisition.can.slcan import SlcanBus
from acquisition.clock import SystemClock
from acquisition.daq.can_dbc import daq_dbc
from acquisition.daq.can_device import CanDevice
from acquisition.daq.can_shape import CanShape, DaqSignal
from acquisition.daq.can_slcan import SlcanTcpServer
from service.cli.probe_can import can

app = typer.Typer()
app.command()(can)

SHAPE = CanShape(
    channels=tuple(DaqSignal(f"c{n}", "V") for n in range(4)),
    slow=(DaqSignal("oil", "degC"), DaqSignal("power", "MW")),
)


@pytest.fixture
async def server(counting_feed) -> AsyncIterator[SlcanTcpServer]:
    device = CanDevice(counting_feed(n_channels=4), SHAPE)
    async with SlcanTcpServer(device, SystemClock()) as server:
        yield server


async def probed(server, *options):
    endpoint = server.endpoint
    place = ["--interface", endpoint["interface"], "--channel", endpoint["channel"]]
    args = [*place, "--seconds", "0.7", *options]
    return await asyncio.to_thread(CliRunner().invoke, app, args)


async def test_it_shows_rates_lengths_and_both_byte_orders_without_a_dbc(server):
    result = await probed(server, "--json")
    assert result.exit_code == 0, result.output
    look = json.loads(result.output)
    by_id = {message["frame_id"]: message for message in look["messages"]}
    wave = by_id[SHAPE.waves[0].frame_id]
    assert wave["lengths"] == [8]
    assert wave["frames_per_s"] > 100
    assert [word["smoother"] for word in wave["words"]] == ["little"] * 4
    assert wave["words"][1]["little"]["minimum"] == 0.0
    assert look["not_seen"] == []


async def test_lines_that_are_no_frames_are_counted_as_malformed(server, monkeypatch):
    def with_time(self, data):
        return taken(self, data.replace(b"\r", b"1A2B\r"))

    taken = SlcanBus._take
    monkeypatch.setattr(SlcanBus, "_take", with_time)
    look = json.loads((await probed(server, "--json")).output)
    assert look["messages"] == []
    assert look["n_malformed"] > 100
    assert "malformed frames" in (await probed(server)).output


async def test_with_a_dbc_signals_are_decoded_and_what_is_missing_is_named(server, tmp_path):
    dbc = tmp_path / "daq.dbc"
    text = daq_dbc(SHAPE).replace("\nBO_ 256", "\nBO_ 1000 GONE: 8 DAQ\n\nBO_ 256", 1)
    dbc.write_text(text, encoding="utf-8")
    result = await probed(server, "--dbc", str(dbc))
    assert result.exit_code == 0, result.output
    assert "oil" in result.output
    assert "45 … 45" in " ".join(result.output.split())
    assert "power none … none MW" in " ".join(result.output.split())
    assert "in the DBC but not seen: GONE" in result.output
    data = json.loads((await probed(server, "--dbc", str(dbc), "--json")).output)
    names = {m["name"] for m in data["messages"]}
    assert {"HEAD", "WAVE_0", "SLOW_0"} <= names


async def test_a_dbc_of_another_device_does_not_fit_and_says_how(server, tmp_path):
    dbc = tmp_path / "daq.dbc"
    shape = CanShape(channels=SHAPE.channels, slow=SHAPE.slow, fd=True)
    dbc.write_text(daq_dbc(shape), encoding="utf-8")
    result = await probed(server, "--dbc", str(dbc))
    assert "does not fit: the DBC says CAN FD" in result.output
    assert "not in the DBC" in result.output


async def test_a_silent_bus_shows_nothing_and_nothing_is_sent(counting_feed):
    device = CanDevice(counting_feed(n_channels=4), SHAPE)
    async with SlcanTcpServer(device) as server:
        device.next_frames()
        result = await probed(server)
        assert "0 frames of 0 ids" in result.output
        while "C" not in server.commands:
            await asyncio.sleep(0)
        assert set(server.commands) == {"L", "C"}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--interface", "nosuch", "--channel", "x"], "nosuch"),
        (["--interface", "slcan", "--channel", "/dev/ttyNONE"], "No such file"),
        (["--interface", "virtual", "--channel", "x", "--dbc", "none.dbc"], "none.dbc: No such"),
        (["--interface", "virtual", "--channel", "x", "--option", "a"], "must be KEY=VALUE"),
    ],
)
def test_what_cannot_be_probed_is_told_in_a_line(options, words):
    result = CliRunner().invoke(app, options)
    assert result.exit_code != 0
    assert words in result.output
