"""Many simulated machines behind one DAQ process."""

import json
from collections.abc import Callable
from pathlib import Path

from acquisition.clock import SystemClock
from service.measuring.sources import source_of
from service.settings.loading import load_plant_file


async def test_all_machines_of_a_daq_begin_when_it_begins_to_serve(
    start: Callable, tmp_path: Path, demo_file: Path
) -> None:
    """Making each takes a while; the first must not look as if its clock were behind for that."""
    daq = await start("daq", str(demo_file))
    endpoints = json.loads(await daq.process.stdout.readline())
    text = demo_file.read_text(encoding="utf-8")
    for endpoint in endpoints.values():
        text = text.replace("port = 0", f"port = {endpoint['port']}", 1)
    served = tmp_path / "plant.toml"
    served.write_text(text, encoding="utf-8")

    begun_ns = set()
    for unit in load_plant_file(served).unit:
        async with source_of(unit, SystemClock()).connect() as stream:
            block = await anext(stream)
        begun_ns.add(block.start_ns - round(block.first_index * 1e9 / block.rate_hz))
    assert len(endpoints) > 1
    assert max(begun_ns) - min(begun_ns) <= 2_000  # stamps are whole microseconds
