"""Simulated devices with register maps and queues, where the unit's source looks for them."""

from pathlib import Path

from acquisition.clock import Clock
from acquisition.simulated.devices.fifo_device import FifoDevice
from acquisition.simulated.devices.map_device import MapDevice, VectorDevice
from acquisition.simulated.devices.modbus_device import ModbusDevice
from acquisition.simulated.devices.modbus_links import ModbusRtuServer, ModbusTcpServer
from acquisition.simulated.devices.modbus_server import ModbusServer
from acquisition.simulated.feed import SampleFeed
from core.machine.unit import Unit
from core.samples.calibration import UnitCalibration
from service.settings.modbus_link import ModbusLinkSettings
from service.settings.modbus_sources import (
    ModbusFifoSettings,
    ModbusPolledSettings,
    ModbusVectorSettings,
)

VECTOR_WINDOW_S = 10.0
"""What a simulated rack looks at: fifteen turns of a slow machine."""


def polled_device(
    source: ModbusPolledSettings,
    unit: Unit,
    calibration: UnitCalibration,
    feed: SampleFeed,
    *,
    on_demand: bool,
) -> MapDevice:
    """Registers that show the newest sample of a feed."""
    rows = [channel.id for channel in unit.channels]
    device = MapDevice(feed, source.registers, rows, calibration, unit.id)
    device.on_demand = on_demand
    return device


def vector_device(
    source: ModbusVectorSettings,
    unit: Unit,
    calibration: UnitCalibration,
    feed: SampleFeed,
    *,
    on_demand: bool,
) -> VectorDevice:
    """A rack that makes vectors of a feed, anew for each poll.

    Raises
    ------
    LookupError
        If the unit has no speed channel.
    """
    if unit.speed_channel is None:
        raise LookupError(f"a simulated rack of unit {unit.id} needs its speed_channel")
    step_samples = max(1, round(min(source.poll_period_s, 1.0) * calibration.rate_hz))
    window_samples = max(1, round(VECTOR_WINDOW_S * calibration.rate_hz))
    device = VectorDevice(
        feed,
        source.registers,
        source.rows,
        calibration,
        channels=[channel.id for channel in unit.channels],
        speed_channel=unit.speed_channel,
        unit=unit.id,
        step_samples=step_samples,
        window_samples=max(window_samples, step_samples),
    )
    device.on_demand = on_demand
    return device


def fifo_device(
    source: ModbusFifoSettings, unit: Unit, feed: SampleFeed, *, on_demand: bool
) -> FifoDevice:
    """Queues that a feed's samples wait in."""
    device = FifoDevice(feed, source.fifo_layout(len(unit.channels)), unit.id)
    device.on_demand = on_demand
    return device


def modbus_server(
    device: ModbusDevice, source: ModbusLinkSettings, clock: Clock | None, *, patient: bool
) -> ModbusServer:
    """Serves a device where a source looks for it, over TCP or on a serial line.

    Parameters
    ----------
    clock
        Paces the device; without one it produces as fast as its reader reads.
    patient
        Whether time begins with the reader's first request.
    """
    if source.host is not None:
        return ModbusTcpServer(device, clock, source.host, source.port, patient=patient)
    line = None if source.device in (None, "pty") else Path(source.device)
    return ModbusRtuServer(device, clock, line, patient=patient)
