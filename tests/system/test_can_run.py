"""A CAN unit in the running program, at each kind of slcan adapter."""

import os
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
from rigs.tiers import fast_and_long

from acquisition.clock import SystemClock
from acquisition.daq.can_device import CanDevice
from acquisition.daq.can_slcan import SlcanPtyServer, SlcanTcpServer
from service.settings.can import CanSettings
from service.settings.loading import load_plant_file
from service.wiring.can import can_shape_of
from service.wiring.simulations import simulated_feed

Start = Callable[..., Awaitable[Any]]

SERVERS = {"tcp": SlcanTcpServer, "pty": SlcanPtyServer}


@pytest.mark.parametrize("kind", fast_and_long("pty", "tcp"))
async def test_a_unit_over_can_is_read_by_the_program_and_comes_back_when_plugged_in_again(
    kind: str, start: Start, tmp_path: Path, demo_file: Path, write_plant: Callable[..., Path]
) -> None:
    unit = load_plant_file(demo_file).unit[0]
    source = CanSettings(
        kind="can", interface="slcan", channel="socket://127.0.0.1:0", profile="padwatch_int16"
    )
    clock = SystemClock()
    device = CanDevice(simulated_feed(unit, clock), can_shape_of(unit, source), unit.id)
    async with SERVERS[kind](device, clock) as server:
        over_can = (
            f'kind = "can"\ninterface = "slcan"\nchannel = "{server.endpoint["channel"]}"\n'
            'profile = "padwatch_int16"\n'
        )
        plant = write_plant(tmp_path, {"U1": 0}, source=over_can)
        program = await start("run", str(plant), "--port", "0")
        await program.wait_for_url()

        async def receive(n_samples: int) -> int:
            units = await program.until(
                "/api/v1/units", lambda found: found[0]["source"]["n_stored"] >= n_samples
            )
            return int(units[0]["source"]["n_stored"])

        before = await receive(100)
        server.inject("bus_off")
        while "bus-off" not in program.errors:
            before = await receive(before + 1)
        await receive(before + 600)
    assert await program.end() == os.EX_OK
