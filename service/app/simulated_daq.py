"""Simulated DAQ: devices and servers for the units of a plant file."""

import asyncio
import json
import os
import threading
from collections.abc import Callable, Mapping
from contextlib import AsyncExitStack, suppress
from dataclasses import replace
from enum import StrEnum
from pathlib import Path

from acquisition.clock import Clock
from acquisition.errors import AcquisitionError
from acquisition.simulated.devices.fifo_device import FifoDevice
from acquisition.simulated.devices.map_device import MapDevice, VectorDevice
from acquisition.simulated.devices.modbus_device import ModbusDevice
from acquisition.simulated.devices.modbus_links import ModbusRtuServer, ModbusTcpServer
from acquisition.simulated.devices.modbus_server import ModbusServer
from acquisition.simulated.devices.ring_device import RingDevice, RingDeviceSettings
from acquisition.simulated.devices.server import DaqServer
from acquisition.simulated.feed import SampleFeed
from service.runtime.process import stop_on_signals
from service.settings.can_values import can_daq_of
from service.settings.core_values import calibration_of
from service.settings.plant import PlantFile
from service.settings.sources.can import CanSettings
from service.settings.sources.devices import (
    ModbusFifoSettings,
    ModbusPolledSettings,
    ModbusRingSettings,
    ModbusSettings,
    ModbusVectorSettings,
    SimulatedSettings,
)
from service.settings.sources.modbus import ModbusLinkSettings
from service.settings.units import UnitSettings

Print = Callable[[str], None]

MAX_COUNT = 1_000_000
"""Largest number of faults of one command; each fault is queued."""

_STANDARD_INPUT = 0


async def run_daq(servers: Mapping[str, DaqServer], print_line: Print, *, controlled: bool) -> None:
    """Run the device servers until SIGINT or SIGTERM, or until standard input ends.

    Prints lines of JSON: first the endpoint of each unit, later ``{"ended": unit}`` when the
    recording of a unit ends, and the answer to each command.

    With `controlled`, commands are read from standard input, and the end of the input stops the
    DAQ. Raises `AcquisitionError` if a server cannot listen, or fails later.
    """
    stopped = stop_on_signals()
    async with AsyncExitStack() as stack:
        for server in servers.values():
            await stack.enter_async_context(server)
        print_line(json.dumps({unit: dict(server.endpoint) for unit, server in servers.items()}))
        try:
            async with asyncio.TaskGroup() as tasks:
                jobs = [_serve(*entry, print_line) for entry in servers.items()]
                if controlled:
                    jobs.append(_execute_commands(servers, print_line, stopped))
                running = [tasks.create_task(job) for job in jobs]
                await stopped.wait()
                for task in running:
                    task.cancel()
        except ExceptionGroup as errors:
            _, others = errors.split(AcquisitionError)
            raise errors if others else errors.exceptions[0] from None


async def _serve(unit: str, server: DaqServer, print_line: Print) -> None:
    await server.run()
    print_line(json.dumps({"ended": unit}))


async def _execute_commands(
    servers: Mapping[str, DaqServer], print_line: Print, stopped: asyncio.Event
) -> None:
    lines: asyncio.Queue[str] = asyncio.Queue()
    reading = (asyncio.get_running_loop(), lines.put_nowait)
    threading.Thread(target=_read_lines, args=reading, daemon=True, name="commands").start()
    while line := await lines.get():
        print_line(json.dumps(execute_command(servers, line)))
    stopped.set()


def _read_lines(loop: asyncio.AbstractEventLoop, put: Callable[[str], None]) -> None:
    """Read standard input in a thread; put its lines on the queue, then an empty line.

    Lines are dropped once the event loop is closed.
    """
    with suppress(RuntimeError):
        with suppress(OSError), open(os.dup(_STANDARD_INPUT), errors="replace") as lines:
            for line in lines:
                loop.call_soon_threadsafe(put, line)
        loop.call_soon_threadsafe(put, "")


def execute_command(servers: Mapping[str, DaqServer], line: str) -> dict[str, str]:
    """Inject faults into the simulated device of a unit by a command ``UNIT FAULT [COUNT]``.

    `servers` are the device servers by unit id; `line` is the command.

    Returns
    -------
    dict
        Key "done" with the command, or key "refused" with the reason.
    """
    words = line.split()
    if len(words) not in (2, 3) or (len(words) == 3 and not words[2].isdecimal()):
        return {"refused": f"command must be UNIT FAULT [COUNT], got {line.strip()!r}"}
    unit, fault, *count = words
    if count and int(count[0]) > MAX_COUNT:
        return {"refused": f"COUNT must be at most {MAX_COUNT}, got {count[0]}"}
    if unit not in servers:
        return {"refused": f"unknown unit {unit}; known units: {', '.join(servers)}"}
    try:
        servers[unit].inject(fault, *map(int, count))
    except LookupError as error:
        return {"refused": str(error.args[0])}
    return {"done": " ".join(words)}


VECTOR_WINDOW_S = 10.0
"""Analysis window of a simulated rack, s: fifteen revolutions of a slow machine."""


def modbus_device(unit: UnitSettings, source: ModbusSettings, feed: SampleFeed) -> ModbusDevice:
    """Return the simulated device of a Modbus source of a unit, with the samples of a feed.

    Raises
    ------
    ConfigError
        If the unit exceeds the limits of the device.
    LookupError
        If the unit of a rack has no speed channel.
    """
    ids, calibration = [channel.id for channel in unit.channel], calibration_of(unit)
    match source:
        case ModbusRingSettings():
            base, n_samples = source.base_address, unit.block_samples  # one block per slot
            shape = RingDeviceSettings(base_address=base, samples_per_slot=n_samples)
            if (own := unit.simulation) is not None:
                n_samples = own.samples_per_slot
                shape = replace(shape, samples_per_slot=n_samples, n_slots=own.n_slots)
            return RingDevice(feed, unit.id, shape)
        case ModbusFifoSettings():
            return FifoDevice(feed, source.fifo_layout(len(ids)), unit.id)
        case ModbusPolledSettings():
            return MapDevice(feed, source.registers, ids, calibration, unit.id)
        case ModbusVectorSettings():
            if unit.speed_channel is None:
                words = f"unit {unit.id}: a simulated rack requires speed_channel; set it"
                raise LookupError(words)
            step_samples = max(1, round(min(source.poll_period_s, 1.0) * calibration.rate_hz))
            return VectorDevice(
                *(feed, source.registers, source.rows, calibration),
                channels=ids,
                speed_channel=unit.speed_channel,
                unit=unit.id,
                step_samples=step_samples,
                window_samples=max(round(VECTOR_WINDOW_S * calibration.rate_hz), step_samples),
            )


def modbus_server(
    device: ModbusDevice, source: ModbusLinkSettings, clock: Clock | None, *, patient: bool
) -> ModbusServer:
    """Return the Modbus server of a device at the address of a source, TCP or serial line.

    `clock` paces the device; None produces samples as fast as they are read. With `patient`, the
    device starts to produce samples at the first request.
    """
    device.on_demand = clock is None
    if source.host is not None:
        return ModbusTcpServer(device, clock, source.host, source.port, patient=patient)
    line = None if source.device in (None, "pty") else Path(source.device)
    return ModbusRtuServer(device, clock, line, patient=patient)


def daq_of(
    unit: UnitSettings, feed: SampleFeed, clock: Clock | None, *, recorded: bool
) -> DaqServer:
    """Return a simulated DAQ of the kind of a unit's source.

    `clock` paces the device; None produces samples as fast as they are read. With `recorded`, the
    feed is a recording: the device waits for its reader, without loss.

    Raises
    ------
    ConfigError
        If the unit exceeds the limits of the device.
    LookupError
        If the source of the unit has no device.
    """
    match unit.source:
        case CanSettings() as source:
            return can_daq_of(unit, source, feed, clock, patient=recorded)
        case SimulatedSettings():
            raise LookupError(f'unit {unit.id} has source kind "simulated", which needs no DAQ')
        case source:
            device = modbus_device(unit, source, feed)
            if isinstance(device, RingDevice):
                device.patient = recorded
            return modbus_server(device, source, clock, patient=recorded)


_LOOPBACK = "127.0.0.1"

STALE_AFTER_S = 5.0
"""Silence of a device, s, after which a finished run ends; longer than a start."""


class Wire(StrEnum):
    """Protocol and transport over which a simulated DAQ is read."""

    MODBUS_TCP = "modbus_tcp"
    MODBUS_RTU = "modbus_rtu"
    CAN = "can"
    CAN_FD = "can_fd"


def over_wire(plant: PlantFile, wire: Wire) -> PlantFile:
    """Return a copy of the plant with a source of kind `wire` for each unit, without addresses.

    Fast polls do not limit the speed of a replay.
    """
    source: CanSettings | ModbusRingSettings
    if wire in (Wire.CAN, Wire.CAN_FD):
        source = CanSettings(
            kind="can",
            interface="slcan",
            channel=f"socket://{_LOOPBACK}:0",
            fd=wire is Wire.CAN_FD,
            profile="padwatch_int16",
            stale_after_s=STALE_AFTER_S,
            when_full="wait",
        )
    else:
        where = {"host": _LOOPBACK, "port": 0} if wire is Wire.MODBUS_TCP else {"device": "pty"}
        times = {"poll_period_s": 0.02, "timeout_s": 2.0, "stale_after_s": STALE_AFTER_S}
        source = ModbusRingSettings(kind="modbus_ring", **where, **times)
    units = tuple(
        # the recording of a polled source has the rate of its polls
        unit.model_copy(update={"source": source, "rate_hz": unit.sampling_hz})
        for unit in plant.unit
    )
    return plant.model_copy(update={"unit": units})
