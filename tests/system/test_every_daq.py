"""The whole service on every kind of DAQ at once, each simulated in one other process."""

import asyncio
import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.slow

LINK = {"host": "127.0.0.1", "port": 0}
CAN = {"kind": "can", "interface": "slcan", "profile": "padwatch_int16"}


def address(place: int) -> dict[str, Any]:
    return {"address": 100 + 2 * place, "type": "float32"}


def sources(channels: list[str], slow: list[str]) -> dict[str, dict[str, Any]]:
    """A source of every kind, where no DAQ has said yet where it is."""
    every = [*channels, *slow]
    values = [{"channel": id_, **address(n)} for n, id_ in enumerate(every)]
    amplitude = {"quantity": "order1_amplitude", "detector": "pp"}
    vectors = [v | (amplitude if v["channel"] in channels else {}) for v in values]
    polled = {"kind": "modbus_polled", "poll_period_s": 0.04, "map": {"value": values}}
    rack = {"kind": "modbus_vector", "poll_period_s": 0.5, "map": {"value": vectors}}
    return {
        "TCP": {"kind": "modbus_ring", **LINK},
        "RTU": {"kind": "modbus_ring", "device": "pty", "parity": "none"},
        "FIFO": {"kind": "modbus_fifo", "addresses": [1000], **LINK},
        "POLLED": polled | LINK,
        "RACK": rack | LINK,
        "CAN": CAN | {"channel": "socket://127.0.0.1:0"},
        "CANFD": CAN | {"channel": "pty", "fd": True, "options": {"sleep_after_open": 0.0}},
    }


def plant_file(path: Path, demo_file: Path, places: dict[str, Any]) -> Path:
    """The first unit of the demo behind each source; JSON's tables are not TOML's, but nearly."""
    text = demo_file.read_text()
    head, unit = text.split("[[unit]]\n")[:2]
    demo = tomllib.loads("[[unit]]\n" + unit)["unit"][0]
    before, _, after = unit.partition("[unit.source]\n")
    after = after[after.index("\n\n") :]
    ids = [[c["id"] for c in demo[kind]] for kind in ("channel", "slow_channel")]
    parts = [head.replace("var/demo", "data").replace("[[unit]]", ""), ANALYSIS]
    for name, source in sources(*ids).items():
        found = before.replace('"U1"', f'"{name}"').replace("Unit 1, part load", name)
        parts.append(f"[[unit]]\n{found}source = {inline(source | places.get(name, {}))}\n{after}")
    path.write_text("\n".join(parts))
    return path


ANALYSIS = "[analysis]\nmax_frequency_hz = 12.0\n"


def inline(value: Any) -> str:
    """A value as TOML."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {inline(v)}" for key, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(inline, value)) + "]"
    return json.dumps(value)


async def test_one_service_reads_every_kind_of_daq(
    start: Callable, tmp_path: Path, demo_file: Path
) -> None:
    daq = await start("daq", str(plant_file(tmp_path / "daq.toml", demo_file, {})))
    assert daq.process.stdout is not None
    places = json.loads(await daq.process.stdout.readline())
    watched = plant_file(tmp_path / "plant.toml", demo_file, places)
    program = await start("run", str(watched), "--port", "0")
    await program.wait_for_url()

    def all_flow(units: list[dict[str, Any]]) -> bool:
        return all(unit["source"]["n_stored"] > 10 for unit in units)

    units = await program.until("/api/v1/units", all_flow)
    assert [unit["id"] for unit in units] == list(places)
    assert {unit["source"]["state"] for unit in units} == {"connected"}
    await program.end()

    polls = await start(
        *("record", str(watched), "--unit", "POLLED", "--seconds", "1", "--out", "runs/polls")
    )
    async with asyncio.timeout(60):
        assert await polls.process.wait() == 0
    manifest = json.loads((tmp_path / "runs" / "polls" / "manifest.json").read_text())
    assert manifest["rate_hz"] == 25.0
