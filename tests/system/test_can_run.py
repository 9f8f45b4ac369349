"""A CAN unit in the running program, at each kind of slcan adapter."""

import os
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from acquisition.clock import SystemClock
from acquisition.daq.can_device import CanDevice
from acquisition.daq.can_slcan import SlcanPtyServer, SlcanTcpServer
from service.settings.can import CanSettings
from service.settings.loading import load_plant_file
from service.wiring.can import can_shape_of
from service.wiring.simulations import simulated_feed

Start = Callable[..., Awaitable[Any]]

SOURCE = 'kind = "modbus_ring"\nhost = "127.0.0.1"\nport = 0\n'
SERVERS = {"tcp": SlcanTcpServer, "pty": SlcanPtyServer}


def write_plant(path: Path, demo_file: Path, channel: str) -> Path:
    """Write a plant file: the demo's first unit, over CAN."""
    head, unit = demo_file.read_text(encoding="utf-8").split("[[unit]]\n")[:2]
    assert SOURCE in unit
    over_can = (
        f'kind = "can"\ninterface = "slcan"\nchannel = "{channel}"\nprofile = "padwatch_int16"\n'
    )
    head = head.replace("var/demo", str(path.parent)).replace("port = 8080", "port = 0")
    path.write_text(f"{head}[[unit]]\n{unit.replace(SOURCE, over_can)}", encoding="utf-8")
    return path


@pytest.mark.parametrize("kind", SERVERS)
async def test_a_unit_over_can_is_read_by_the_program_and_comes_back_when_plugged_in_again(
    kind: str, start: Start, tmp_path: Path, demo_file: Path
) -> None:
    unit = load_plant_file(demo_file).unit[0]
    source = CanSettings(
        kind="can", interface="slcan", channel="socket://127.0.0.1:0", profile="padwatch_int16"
    )
    clock = SystemClock()
    device = CanDevice(simulated_feed(unit, clock), can_shape_of(unit, source), unit.id)
    async with SERVERS[kind](device, clock) as server:
        plant = write_plant(tmp_path / "plant.toml", demo_file, str(server.endpoint["channel"]))
        program = await start("run", str(plant))
        await program.wait_for_url()
        units = "/api/v1/units"

        def received(n_samples: int) -> Callable[[Any], bool]:
            return lambda found: found[0]["source"]["n_stored"] >= n_samples

        before = (await program.until(units, received(600)))[0]["source"]["n_stored"]
        server.inject("bus_off")
        await program.until(units, received(before + 3000))
        assert "bus-off" in program.errors
    assert await program.end() == os.EX_OK
