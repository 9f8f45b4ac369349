"""`padwatch probe`: registers of a Modbus device, read once and not stored."""

import asyncio
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from pydantic import ValidationError

from acquisition.modbus.cells import ByteOrder
from core.machine.channel import Measurand
from service.cli.offline.probing import (
    RegisterLook,
    RingLook,
    ValueLook,
    identify_once,
    looks,
    measure_in_flight,
    read_map_once,
    read_once,
    read_ring_once,
    ring_look,
    value_looks,
)
from service.cli.options import (
    JsonOutput,
    UnitOption,
    command_group,
    fail,
    one_unit,
    print_result,
)
from service.runtime.times import rfc3339
from service.settings.plant import PlantFile, load_plant_file
from service.settings.sources.devices import MappedDeviceSettings
from service.settings.sources.modbus import ModbusLinkSettings
from service.settings.sources.register_map import load_map_file
from service.settings.toml_file import TomlFileError
from service.settings.units import UnitSettings

app = command_group("Read a device once and print its data; nothing is stored.")

MAX_COUNT = 1000
MAX_IN_FLIGHT = 16
BIT_FUNCTIONS = (1, 2)
RTU_PREFIX = "/"
SINGLES = ("int16", "uint16")
MEASURAND_UNITS = {
    Measurand.GAP_UM: "µm",
    Measurand.DISPLACEMENT_UM: "µm",
    Measurand.VELOCITY_MM_S: "mm/s",
    Measurand.ACCELERATION_M_S2: "m/s²",
    Measurand.KEY_PHASE_V: "V",
}

DevicePlace = Annotated[
    str,
    typer.Argument(help="HOST[:PORT], or the path of a serial port.", metavar="HOST[:PORT]|/dev/…"),
]
UnitIdOption = Annotated[int, typer.Option("--unit-id", min=1, max=255, help="Modbus unit id.")]
TimeoutOption = Annotated[float, typer.Option(min=0.05, max=60.0, help="Time-out of a reply, s.")]
BaudOption = Annotated[int, typer.Option(help="Bit rate of a serial port, bit/s.")]
ParityOption = Annotated[str, typer.Option(help='"none", "even" or "odd" of a serial port.')]


@app.command()
def modbus(
    device: DevicePlace,
    address: Annotated[int, typer.Option(min=0, max=65535, help="First register, from 0.")],
    count: Annotated[int, typer.Option(min=1, max=MAX_COUNT, help="Number of values.")] = 10,
    function: Annotated[int, typer.Option(min=1, max=4, help="Function code 1 to 4.")] = 3,
    unit_id: UnitIdOption = 1,
    timeout_s: TimeoutOption = 1.0,
    baudrate: BaudOption = 115_200,
    parity: ParityOption = "even",
    json_output: JsonOutput = False,
) -> None:
    """Print registers as raw numbers, and decoded as every number type in every byte order.

    A float between 0.001 and 1,000,000 is marked, since its byte order is plausible.
    """
    place = _place(device, unit_id, timeout_s, baudrate, parity)
    data = asyncio.run(read_once(place, function, address, count))
    if function in BIT_FUNCTIONS:
        bits = [data[n // 8] >> n % 8 & 1 for n in range(count)]
        rows: list[Any] = [{"address": address + n, "bit": bit} for n, bit in enumerate(bits)]
        lines = [f"{row['address']:>6} {row['bit']}" for row in rows]
    else:
        found = looks(data, address)
        rows, lines = [*found], list(_register_table(found))
    print_result(rows, lines, json_output)


@app.command("map")
def map_(
    file: Annotated[Path, typer.Argument(help="A plant file, or with --at a register map.")],
    unit: UnitOption = None,
    at: Annotated[
        str | None, typer.Option(help="HOST[:PORT] or /dev/…: try a register map there.")
    ] = None,
    slow: Annotated[bool, typer.Option(help="Read the slow_source of the unit.")] = False,
    unit_id: UnitIdOption = 1,
    timeout_s: TimeoutOption = 1.0,
    baudrate: BaudOption = 115_200,
    parity: ParityOption = "even",
    json_output: JsonOutput = False,
) -> None:
    """Read a register map once; print each value with its unit, raw registers and status flags."""
    if at is None:
        settings = one_unit(_plant(file), unit, file)
        device = _mapped_device(settings, slow)
        units = {channel.id: MEASURAND_UNITS[channel.measurand] for channel in settings.channel}
        units |= {channel.id: channel.unit for channel in settings.slow_channel}
        registers = device.registers
        place: ModbusLinkSettings = device
    else:
        units, registers = {}, load_map_file(file).register_map()
        place = _place(at, unit_id, timeout_s, baudrate, parity)
    found = value_looks(*asyncio.run(read_map_once(place, registers)))
    rows = [asdict(look) | {"unit": _unit(look, units)} for look in found]
    print_result(rows, _value_table(found, units), json_output)


@app.command()
def ring(
    device: DevicePlace,
    base_address: Annotated[int, typer.Option(min=0, max=65535, help="Address of the header.")] = 0,
    function: Annotated[int, typer.Option(min=3, max=4, help="Function code 3 or 4.")] = 3,
    unit_id: UnitIdOption = 1,
    timeout_s: TimeoutOption = 1.0,
    baudrate: BaudOption = 115_200,
    parity: ParityOption = "even",
    json_output: JsonOutput = False,
) -> None:
    """Print the layout of a block ring, and the slow values and counts of its newest slot."""
    place = _place(device, unit_id, timeout_s, baudrate, parity)
    look = ring_look(*asyncio.run(read_ring_once(place, base_address, function)))
    print_result(look, _ring_lines(look), json_output)


@app.command()
def identity(
    device: DevicePlace,
    unit_id: UnitIdOption = 1,
    timeout_s: TimeoutOption = 1.0,
    baudrate: BaudOption = 115_200,
    parity: ParityOption = "even",
    json_output: JsonOutput = False,
) -> None:
    """Print vendor, product code and revision of a device (function 43/14)."""
    place = _place(device, unit_id, timeout_s, baudrate, parity)
    found = asdict(asyncio.run(identify_once(place)))
    lines = [f"{name.replace('_', ' ')}: {text}" for name, text in found.items()]
    print_result(found, lines, json_output, indent=None)


@app.command("in-flight")
def in_flight(
    device: DevicePlace,
    address: Annotated[int, typer.Option(min=0, max=65535, help="Address of a register.")] = 0,
    function: Annotated[int, typer.Option(min=3, max=4, help="Function code 3 or 4.")] = 3,
    unit_id: UnitIdOption = 1,
    timeout_s: TimeoutOption = 1.0,
) -> None:
    """Measure how many simultaneous requests a Modbus TCP device answers."""
    place = _place(device, unit_id, timeout_s, 115_200, "even")
    if place.host is None:
        fail("a serial line allows only one request at a time; give HOST[:PORT]", code=2)
    found = asyncio.run(measure_in_flight(place, address, function, MAX_IN_FLIGHT))
    typer.echo(f"requests_in_flight = {found}")


def _place(
    device: str, unit_id: int, timeout_s: float, baudrate: int, parity: str
) -> ModbusLinkSettings:
    given: dict[str, Any] = {"device_id": unit_id, "timeout_s": timeout_s}
    if device.startswith(RTU_PREFIX):
        given |= {"device": device, "baudrate": baudrate, "parity": parity}
    else:
        host, colon, port = device.rpartition(":")
        given |= {"host": host if colon else device}
        given |= {"port": port} if colon else {}
    try:
        return ModbusLinkSettings.model_validate(given)
    except ValidationError as error:
        what = error.errors()[0]
        key = what["loc"][-1] if what["loc"] else "device"
        fail(
            f"invalid device {device}: {key}: {what['msg']}; use HOST[:PORT] or /dev/… of a port",
            code=2,
        )


def _plant(file: Path) -> PlantFile:
    try:
        return load_plant_file(file)
    except TomlFileError:
        with suppress(TomlFileError):
            load_map_file(file)
            fail(f"{file} is a register map; name its device with --at", code=2)
        raise


def _mapped_device(unit: UnitSettings, slow: bool) -> MappedDeviceSettings:
    device = getattr(unit, "slow_source", None) if slow else unit.source
    if not isinstance(device, MappedDeviceSettings):
        key = "slow_source" if slow else "source"
        fail(f"{key} of unit {unit.id} has no register map; use `padwatch probe modbus`", code=2)
    return device


def _unit(look: ValueLook, units: dict[str, str]) -> str:
    channel, _, part = look.id.partition(".")
    unit = units.get(channel, "")
    if part.endswith("phase"):
        return "deg lead"
    return f"{unit} pk" if part.endswith("amplitude") or part == "overall" else unit


def _register_table(found: list[RegisterLook]) -> Iterator[str]:
    yield (
        f"{'address':>7} {'raw':>7} {'order':>6} {'int16':>7} {'uint16':>7}"
        f" {'int32':>12} {'uint32':>11} {'float32':>14}"
    )
    for look in found:
        for n, order in enumerate(ByteOrder):
            where = f"{look.address:>7}  {look.raw:#06x}" if n == 0 else " " * 15
            single = " ".join(f"{look.singles[f'{t} {order.pair}']:>7}" for t in SINGLES)
            yield f"{where} {order:>6} {single}{_pair(look, order)}".rstrip()


def _pair(look: RegisterLook, order: str) -> str:
    if not look.pairs:
        return ""
    int32, uint32, float32 = (look.pairs[name][order] for name in ("int32", "uint32", "float32"))
    shown = "nan" if float32 is None else f"{float32:.7g}"
    mark = " *" if order in look.plausible else ""
    return f" {int32:>12} {uint32:>11} {shown:>14}{mark}"


def _ring_lines(look: RingLook) -> Iterator[str]:
    ring_s = look.n_slots * look.samples_per_slot / look.rate_hz
    yield f"block ring, epoch {look.epoch}"
    yield (
        f"{look.n_channels} channels at {look.rate_hz:g} Hz; {look.n_slots} slots of"
        f" {look.samples_per_slot} samples: {ring_s:.1f} s"
    )
    slow = ["none" if value is None else f"{value:.6g}" for value in look.slow]
    yield f"slow values: {', '.join(slow) or 'none'}"
    yield (
        f"newest slot {look.newest}: {look.state}, from sample {look.first_index},"
        f" {rfc3339(look.start_ns)}"
    )
    yield f"{'channel':>7} {'ok':>3} {'minimum':>8} {'mean':>9} {'maximum':>8} (counts)"
    for each in look.channels:
        ok = "yes" if each.ok else "no"
        yield (f"{each.channel:>7} {ok:>3} {each.minimum:>8} {each.mean:>9.1f} {each.maximum:>8}")


def _value_table(found: list[ValueLook], units: dict[str, str]) -> Iterator[str]:
    width = max(len(look.id) for look in found)
    for look in found:
        number = "none" if look.value is None else f"{look.value:.6g}"
        raw = " ".join(f"{word:#06x}" for word in look.registers)
        flags = " ".join(f"{at}={word:#06x}" for at, word in look.flags.items())
        where = f"{look.function}:{look.address} {raw}"
        yield (
            f"{look.id:<{width}} {number:>12} {_unit(look, units):<8} {look.state:<8}"
            f" [{where}] {flags}".rstrip()
        )
