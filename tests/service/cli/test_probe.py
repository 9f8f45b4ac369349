"""`padwatch probe` shows what a device has, in every way it may be meant, and stores nothing."""

import asyncio
import json
import struct
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import numpy as np
import pytest
from rigs.blocks import cell_block
from typer.testing import CliRunner

from acquisition.simulated.devices.map_device import MapDevice
from acquisition.simulated.devices.modbus_links import ModbusTcpServer
from acquisition.simulated.devices.ring_device import RingDevice
from core.samples.blocks import SampleBlock
from core.samples.calibration import SlowCalibration, UnitCalibration
from service.cli.probe import app
from service.settings.sources.register_map import load_map_file

MAPS = Path(__file__).parents[3] / "deploy" / "maps"
GATEWAY = MAPS / "slow-gateway.toml"
SLOW = {
    "speed": 92.25,
    "active_power": 512.5,
    "ujb_oil_temperature": 45.5,
    "ljb_oil_temperature": float("nan"),
}


class SlowFeed:
    """Slow values alone."""

    def __init__(self, slow: tuple[float, ...]) -> None:
        self._slow, self._n = slow, 0

    def advance(self, n_samples: int) -> SampleBlock:
        first, self._n = self._n, self._n + n_samples
        counts = np.zeros((0, n_samples), dtype=np.int16)
        return cell_block(0, first, 1_800_000_000 * 10**9, 1.0, counts, (), self._slow)


@pytest.fixture
def gateway() -> MapDevice:
    slow = tuple(SlowCalibration(id_, -1e9, 1e9) for id_ in SLOW)
    calibration = UnitCalibration("U1", 1.0, (), slow)
    registers = load_map_file(GATEWAY).register_map()
    return MapDevice(SlowFeed(tuple(SLOW.values())), registers, (), calibration)


@pytest.fixture
async def server(gateway: MapDevice) -> AsyncIterator[ModbusTcpServer]:
    async with ModbusTcpServer(gateway) as server:
        yield server


@pytest.fixture
def probe() -> Callable:
    """Run the command in a thread, since the device answers on this one."""

    async def run(*arguments: str):
        return await asyncio.to_thread(CliRunner().invoke, app, [*arguments])

    return run


def at(server: ModbusTcpServer) -> str:
    return f"127.0.0.1:{server.port}"


async def test_registers_are_read_in_every_type_and_order_and_the_likely_one_marked(probe, server):
    look = ("modbus", at(server), "--address", "100", "--count", "2")
    result, table = await probe(*look, "--json"), await probe(*look)

    assert result.exit_code == 0, result.output
    first, last = json.loads(result.stdout)
    straight = struct.pack(">f", 92.25)
    assert first["address"] == 100
    assert first["raw"] == int.from_bytes(straight[2:], "big")
    assert first["pairs"]["float32"]["CDAB"] == 92.25
    assert first["pairs"]["uint32"]["CDAB"] == int.from_bytes(straight, "big")
    backwards = bytes(straight[n] for n in (1, 0, 3, 2))
    assert first["pairs"]["int32"]["DCBA"] == int.from_bytes(backwards, "big", signed=True)
    assert "CDAB" in first["plausible"]
    assert "ABCD" not in first["plausible"]
    assert last["pairs"] == {}
    assert last["singles"]["uint16 AB"] == int.from_bytes(straight[:2], "big")
    assert last["singles"]["uint16 BA"] == int.from_bytes(straight[1::-1], "big")
    marked = [line for line in table.stdout.splitlines() if line.endswith("*")]
    assert [line.split()[-2] for line in marked] == ["92.25"]


async def test_a_map_is_read_once_and_every_value_shown_with_its_registers(probe, server):
    result = await probe("map", str(GATEWAY), "--at", at(server), "--json")

    assert result.exit_code == 0, result.output
    found = {row["id"]: row for row in json.loads(result.stdout)}
    assert found["speed"]["value"] == 92.25
    assert found["active_power"]["value"] == pytest.approx(512.5)
    assert found["ujb_oil_temperature"] | {"unit": ""} == {
        "id": "ujb_oil_temperature",
        "address": 40105,
        "function": 3,
        "registers": [455],
        "value": 45.5,
        "state": "ok",
        "flags": {"40106": 0},
        "unit": "",
    }
    assert found["ljb_oil_temperature"]["state"] == "invalid"


async def test_a_flagged_value_is_shown_with_its_word(probe, server, gateway):
    gateway.spoil("flag", 1)
    gateway.produce()
    result = await probe("map", str(GATEWAY), "--at", at(server))

    [line] = [x for x in result.stdout.splitlines() if x.startswith("ujb_oil_temperature")]
    assert "flagged" in line
    assert "40106=0x0003" in line


async def test_a_block_ring_is_decoded_by_its_own_header(probe, counting_feed):
    device = RingDevice(counting_feed(n_channels=3, slow=(92.25, float("nan"))))
    device.produce(4)
    async with ModbusTcpServer(device) as server:
        table, rows = await probe("ring", at(server)), await probe("ring", at(server), "--json")
        other = await probe("ring", at(server), "--base-address", "1")

    assert table.exit_code == 0, table.output
    assert "3 channels at 600 Hz" in table.stdout
    assert "slow values: 92.25, none" in table.stdout
    found = json.loads(rows.stdout)
    assert (found["state"], found["slow"]) == ("whole", [92.25, None])
    first = found["first_index"]
    assert first == 4 * found["samples_per_slot"]
    assert found["channels"][0] == {
        "channel": 0,
        "ok": True,
        "minimum": first,
        "mean": first + (found["samples_per_slot"] - 1) / 2,
        "maximum": first + found["samples_per_slot"] - 1,
    }
    assert other.exit_code == 1
    assert "magic is" in other.stderr


async def test_the_requests_that_a_device_answers_at_once_are_counted(probe, server):
    found = await probe("in-flight", at(server), "--address", "100")
    assert (found.exit_code, found.stdout) == (0, "requests_in_flight = 16\n"), found.output
    unknown = await probe("in-flight", at(server), "--address", "65535")
    assert unknown.exit_code == 1
    assert "address" in unknown.stderr


async def test_nothing_but_reads_is_sent(probe, server):
    await probe("modbus", at(server), "--address", "100")
    await probe("map", str(GATEWAY), "--at", at(server))
    await probe("identity", at(server))

    assert set(server.function_codes) <= {3, 43}


async def test_a_device_tells_who_it_is(probe, server, gateway):
    gateway.identification = {0: b"Maker", 1: b"Rack 7", 2: b"1.2"}
    result = await probe("identity", at(server), "--json")

    assert json.loads(result.stdout) == {
        "vendor": "Maker",
        "product_code": "Rack 7",
        "revision": "1.2",
    }


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("modbus", "127.0.0.1:{port}", "--address", "5000"), 1, "illegal data address"),
        (("modbus", "127.0.0.1:{port}", "--address", "0", "--function", "1"), 1, "data address"),
        (("modbus", "127.0.0.1:1", "--address", "0"), 1, "refused"),
        (("modbus", "/dev/there-is-none", "--address", "0"), 1, "No such file"),
        (("modbus", "127.0.0.1:port", "--address", "0"), 2, "integer"),
        (("modbus", "127.0.0.1:{port}", "--address", "70000"), 2, "65535"),
        (("modbus", "127.0.0.1:{port}", "--address", "0", "--function", "6"), 2, "or equal to 4"),
        (("map", "absent.toml", "--at", "127.0.0.1:{port}"), 2, "No such file"),
        (("map", "absent.toml"), 2, "No such file"),
    ],
)
async def test_what_cannot_be_read_is_one_sentence(probe, server, arguments, code, said):
    result = await probe(*(a.format(port=server.port) for a in arguments))

    assert result.exit_code == code, result.output
    assert said in result.stderr
    assert "Traceback" not in result.output


async def test_another_device_than_the_map_is_for_is_refused(probe, server, tmp_path):
    path = tmp_path / "map.toml"
    signature = "[[signature]]\naddress = 40101\nexpected = 7\n"
    path.write_text(GATEWAY.read_text().replace("[heartbeat]", signature + "[heartbeat]"))
    result = await probe("map", str(path), "--at", at(server))

    assert result.exit_code == 1
    assert "wrong device: register 40101" in result.stderr


async def test_the_map_of_a_plants_rack_is_read_with_units(probe, tmp_path):
    ids = [
        f"{b}_{p}_{a}" for b in ("ujb", "ljb", "tjb") for p in ("shaft", "bearing") for a in "xy"
    ]
    values = "".join(
        f'[[value]]\nchannel = "{id_}"\nquantity = "order1_amplitude"\ndetector = "pp"\n'
        f'address = {10 * n}\ntype = "float32"\n'
        for n, id_ in enumerate(ids)
    )
    (tmp_path / "map.toml").write_text(f'{values}[[value]]\nchannel = "speed"\naddress = 500\n')
    alone = await probe("map", str(tmp_path / "map.toml"))
    registers = load_map_file(tmp_path / "map.toml").register_map()
    device = MapDevice(
        SlowFeed((92.0,)),
        registers,
        (),
        UnitCalibration("U1", 1.0, (), (SlowCalibration("speed", 0.0, 200.0),)),
    )
    for n, value in enumerate(registers.values[:-1]):
        device.image.put_value(value, 10.0 + n)
    async with ModbusTcpServer(device) as server:
        source = f'kind = "modbus_vector"\nhost = "127.0.0.1"\nport = {server.port}\n'
        source += 'map_file = "map.toml"\npoll_period_s = 5.0\n'
        demo = (MAPS.parent / "demo.toml").read_text()
        ring = 'kind = "modbus_ring"\nhost = "127.0.0.1"\nport = 0\n'
        assert ring in demo
        (tmp_path / "plant.toml").write_text(demo.replace(ring, source, 1))
        plant = str(tmp_path / "plant.toml")
        table = await probe("map", plant, "--unit", "U1")
        rows = await probe("map", plant, "--unit", "U1", "--json")
        other = await probe("map", plant, "--unit", "U2")
        none = await probe("map", plant, "--unit", "U1", "--slow")

    assert table.exit_code == 0, table.output
    found = {row["id"]: row for row in json.loads(rows.stdout)}
    assert found["ujb_shaft_x.order1_amplitude"]["value"] == 10.0
    assert found["ujb_shaft_x.order1_amplitude"]["unit"] == "µm pk"
    assert found["tjb_bearing_y.order1_amplitude"]["unit"] == "mm/s pk"
    assert found["speed"]["unit"] == "r/min"
    assert len(table.stdout.splitlines()) == 13
    assert alone.exit_code == other.exit_code == none.exit_code == 2
    assert "map.toml is a register map; name its device with --at" in alone.stderr
    assert "source of unit U2 has no register map" in other.stderr
    assert "slow_source of unit U1 has no register map" in none.stderr
