"""Modbus source settings of the plant file, as the adapter takes them."""

from typing import Any

from acquisition.clock import Clock
from acquisition.joined_source import JoinedSource
from acquisition.modbus.fifo_source import FifoSettings, FifoSource
from acquisition.modbus.polled_slow_values import PolledSlowValues
from acquisition.modbus.polled_source import PolledSettings, PolledSource
from acquisition.modbus.transport import SerialTransport, TcpTransport, Transport
from acquisition.source import SampleSource
from acquisition.vector_calibration import vector_calibration
from service.conversion import calibration_of
from service.settings.modbus_link import ModbusLinkSettings
from service.settings.modbus_sources import (
    MappedDeviceSettings,
    ModbusFifoSettings,
    ModbusPolledSettings,
    ModbusVectorSettings,
)
from service.settings.units import UnitSettings

_TRANSPORT_KEYS = {"host", "port", "device", "baudrate", "parity", "stop_bits"}


def transport_of(source: ModbusLinkSettings) -> Transport:
    """Where a Modbus device is: on the network, or on a serial line."""
    if source.host is not None:
        return TcpTransport(host=source.host, port=source.port)
    return SerialTransport(
        device=source.device or "",
        baudrate=source.baudrate,
        parity=source.parity,
        stop_bits=source.stop_bits,
    )


def fields_of(source: ModbusLinkSettings) -> dict[str, Any]:
    """All other settings of a source, by name."""
    return source.model_dump(exclude={"kind", *_TRANSPORT_KEYS})


def polled_settings(source: MappedDeviceSettings) -> PolledSettings:
    """How a device with a register map is asked."""
    return PolledSettings(
        transport=transport_of(source),
        device_id=source.device_id,
        timeout_s=source.timeout_s,
        poll_period_s=source.poll_period_s,
        stale_after_s=source.stale_after_s,
    )


def polled_source(source: ModbusPolledSettings, unit: UnitSettings, clock: Clock) -> PolledSource:
    """A device whose registers are the samples."""
    rows = [channel.id for channel in unit.channel]
    settings = polled_settings(source)
    return PolledSource(settings, source.registers, rows, calibration_of(unit), clock)


def vector_source(source: ModbusVectorSettings, unit: UnitSettings, clock: Clock) -> PolledSource:
    """A rack that gives 1× vectors: a row of a block for each that it gives."""
    channels = [channel.id for channel in unit.channel]
    calibration = vector_calibration(calibration_of(unit), channels, source.rows)
    rows = [row.id for row in source.rows]
    return PolledSource(polled_settings(source), source.registers, rows, calibration, clock)


def fifo_source(source: ModbusFifoSettings, unit: UnitSettings, clock: Clock) -> SampleSource:
    """Queues, and what slow values another device gives."""
    settings = FifoSettings(
        transport=transport_of(source),
        device_id=source.device_id,
        timeout_s=source.timeout_s,
        poll_period_s=source.poll_period_s,
        stale_after_s=source.stale_after_s,
        loss_tolerance_s=source.loss_tolerance_s,
    )
    layout = source.fifo_layout(len(unit.channel))
    return FifoSource(settings, layout, calibration_of(unit), clock)


def with_slow_source(source: SampleSource, unit: UnitSettings, clock: Clock) -> SampleSource:
    """The unit's source, joined by a second device where the plant file names one."""
    beside = unit.slow_source
    if beside is None:
        return source
    calibration = calibration_of(unit)
    measured = [channel for channel in calibration.slow if channel.id in beside.mapped_channels]
    slow = PolledSlowValues(polled_settings(beside), beside.registers, measured, clock)
    return JoinedSource(source, slow)
