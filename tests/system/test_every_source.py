"""Every kind of source in the running service behind the DAQ of `padwatch daq`."""

import asyncio
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from rigs.command_line import padwatch_program
from rigs.tiers import first_fast

from acquisition.clock import SystemClock
from service.measuring.sources import source_of
from service.settings.plant import load_plant_file

RECORDED_PLANT = Path(__file__).parents[1] / "recordings" / "plant.toml"
CHANNELS = ("ujb_shaft_x", "ujb_shaft_y", "ujb_bearing_x", "ujb_bearing_y")
SLOW = ("speed", "active_power", "ujb_oil_temperature")
FAST_LINE = "baudrate = 4_000_000\nparity = 'none'"
"""A pseudo-terminal has neither speed nor parity; a high one spares it silence between frames."""

MIN_SAMPLES = 20
POLLED_EACH_S = 0.05
SLOW_HZ = 50.0

POLLED_UP_TO_HZ = 8.0

ONE_OF_EACH = ("RING_TCP", "RING_RTU", "FIFO_TCP", "POLLED_TCP", "VECTOR_RTU", "CAN_LINE")
EVERY_ONE = (
    *("RING_TCP", "RING_RTU", "FIFO_TCP", "FIFO_RTU", "POLLED_TCP", "POLLED_RTU"),
    *("VECTOR_TCP", "VECTOR_RTU", "CAN_TCP", "CAN_FD_TCP", "CAN_LINE"),
)


def register_map(**of_channels: str) -> str:
    """A map of floats for all channels and slow values."""
    more = "".join(f"{key} = {value!r}\n" for key, value in of_channels.items())
    values = [f"channel = '{id_}'\n{more}" for id_ in CHANNELS]
    values += [f"channel = '{id_}'\n" for id_ in SLOW]
    return "".join(
        f"[[unit.source.map.value]]\n{value}address = {100 + 2 * n}\ntype = 'float32'\n"
        for n, value in enumerate(values)
    )


def sources(folder: Path) -> dict[str, str]:
    """A unit's source for each kind and each wire, before it is known where the DAQ is."""
    tcp = "host = '127.0.0.1'\nport = 0\ntimeout_s = 20.0\n"

    def line(name: str) -> str:
        return f"device = '{folder / name}'\n{FAST_LINE}\ntimeout_s = 5.0\n"

    polled = f"kind = 'modbus_polled'\npoll_period_s = {POLLED_EACH_S}\n"
    vector = "kind = 'modbus_vector'\npoll_period_s = 0.2\nn_polls = 20\nhop_polls = 10\n"
    vectors = register_map(quantity="order1_amplitude", detector="pp")
    busy = "stale_after_s = 20.0\n"  # the DAQ gets no processor for seconds on a busy machine
    fifo = f"kind = 'modbus_fifo'\naddresses = [1000]\npoll_period_s = 0.01\n{busy}"
    ring = f"kind = 'modbus_ring'\n{busy}"
    can = f"kind = 'can'\ninterface = 'slcan'\nprofile = 'padwatch_int16'\n{busy}"
    on_tcp, on_line = "channel = 'socket://127.0.0.1:0'\n", f"channel = '{folder / 'can'}'\n"
    return {
        "RING_TCP": ring + tcp,
        "RING_RTU": ring + line("ring"),
        "FIFO_TCP": fifo + tcp,
        "FIFO_RTU": fifo + line("fifo"),
        "POLLED_TCP": polled + tcp + register_map(),
        "POLLED_RTU": polled + line("polled") + register_map(),
        "VECTOR_TCP": vector + tcp + vectors,
        "VECTOR_RTU": vector + line("vector") + vectors,
        "CAN_TCP": can + on_tcp,
        "CAN_FD_TCP": can + "fd = true\n" + on_tcp,
        "CAN_LINE": can + on_line,
    }


def plant_file(
    folder: Path, ids: Sequence[str], found: dict[str, dict[str, Any]] | None = None
) -> Path:
    """The first recorded unit once for each source; its slow values come with the waveforms."""
    head, unit, _ = RECORDED_PLANT.read_text(encoding="utf-8").split("[[unit]]\n")
    before, _, after = unit.partition("[unit.source]")
    after = after[after.index("[[unit.channel]]") :]
    text = head.replace("[analysis]", f"[analysis]\nmax_frequency_hz = {POLLED_UP_TO_HZ}")
    for id_ in ids:
        source = sources(folder)[id_]
        if found and "port" in found[id_]:
            source = source.replace("port = 0", f"port = {found[id_]['port']}")
        if found and str(found[id_].get("channel", "")).startswith("socket"):
            source = source.replace("socket://127.0.0.1:0", str(found[id_]["channel"]))
        mine = before.replace('id = "U1"', f'id = "{id_}"')
        if id_.startswith(("FIFO", "POLLED", "VECTOR")):
            mine = mine.replace("rate_hz = 600.0", f"rate_hz = {SLOW_HZ}")
        text += "[[unit]]\n" + mine
        text += f"[unit.source]\n{source}\n{after}"
    path = folder / "plant.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.long
@pytest.mark.parametrize("ids", first_fast(1, [ONE_OF_EACH, EVERY_ONE]), ids=len)
async def test_the_service_reads_every_kind_of_source_over_every_wire(start, tmp_path, ids):
    daq = await start("daq", str(plant_file(tmp_path, ids)))
    found = json.loads(await daq.process.stdout.readline())
    program = await start("run", str(plant_file(tmp_path, ids, found)), "--port", "0")
    await program.wait_for_url()

    read = {}

    def all_have_delivered(units: list[dict[str, Any]]) -> bool:
        for source in units:
            if source["n_stored"] >= MIN_SAMPLES and source["state"] == "connected":
                read[source["unit"]] = source
        return set(read) == set(ids)

    await program.until("/api/v1/sources", all_have_delivered)
    for id_, source in read.items():
        assert (source["reason"], source["rejected"]) == (None, {}), id_
    await asyncio.gather(*(speed_is_right(program, id_) for id_ in read))
    assert await program.end() == 0
    assert "Traceback" not in program.errors

    recorded = ("--unit", "POLLED_TCP", "--seconds", "1", "--out", tmp_path / "runs" / "polls")
    polls = await asyncio.to_thread(padwatch_program, "record", tmp_path / "plant.toml", *recorded)
    assert polls.exit_code == 0, polls.stderr
    manifest = json.loads((tmp_path / "runs" / "polls" / "manifest.json").read_text())
    assert manifest["rate_hz"] == 1.0 / POLLED_EACH_S
    assert await daq.end() == 0


async def speed_is_right(program: Any, unit: str) -> None:
    """A slow value comes along, whatever the wire; queues have none, slow polls no result yet."""
    if unit.startswith(("FIFO", "POLLED")):
        return
    latest = await program.until(
        f"/api/v1/units/{unit}/bearings/UJB/latest",
        lambda found: found["readings"].get("speed_rpm", {}).get("value") is not None,
    )
    assert latest["readings"]["speed_rpm"]["value"] == pytest.approx(92.3, rel=0.02)


async def test_all_machines_of_a_daq_begin_when_it_begins_to_serve(start, tmp_path, demo_file):
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
