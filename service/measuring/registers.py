"""Sources that are read from registers and queues, and the monitor of a vector rack."""

from dataclasses import replace

from acquisition.clock import Clock
from acquisition.delivery.calibration import UnitCalibration
from acquisition.delivery.joined import JoinedSource, only_slow, without_slow
from acquisition.modbus.fifo_source import FifoSettings, FifoSource
from acquisition.modbus.polled_source import PolledSettings, PolledSource, vector_calibration
from acquisition.modbus.slow_values import PolledSlowValues
from acquisition.source import SampleSource
from core.machine.unit import Unit
from core.monitor.assessment import AnalysisSettings
from core.monitor.monitor import UnitMonitor
from core.spectra.polls import PollTransform
from service.settings.adapter_values import link_fields
from service.settings.sources.devices import (
    MappedDeviceSettings,
    ModbusFifoSettings,
    ModbusPolledSettings,
    ModbusVectorSettings,
    SlowDeviceSettings,
)


def polled_settings(device: MappedDeviceSettings) -> PolledSettings:
    """How a mapped device is asked."""
    return PolledSettings(
        **link_fields(device),
        poll_period_s=device.poll_period_s,
        stale_after_s=device.stale_after_s,
    )


def polled_source(
    source: ModbusPolledSettings, unit: Unit, calibration: UnitCalibration, clock: Clock
) -> SampleSource:
    """Registers as a source; goes with a monitor of the unit :func:`at_poll_rate`."""
    rows = [channel.id for channel in unit.channels]
    calibration = replace(calibration, rate_hz=source.rate_hz)
    return PolledSource(polled_settings(source), source.registers, rows, calibration, clock)


def at_poll_rate(source: ModbusPolledSettings | ModbusVectorSettings, unit: Unit) -> Unit:
    """The unit as its polled source shows it: a sample is a poll."""
    return replace(unit, rate_hz=source.rate_hz)


def vector_source(
    source: ModbusVectorSettings, unit: Unit, calibration: UnitCalibration, clock: Clock
) -> SampleSource:
    """A vector rack as a source; goes with :func:`vector_monitor`."""
    ids = [channel.id for channel in unit.channels]
    return PolledSource(
        polled_settings(source),
        source.registers,
        [row.id for row in source.rows],
        vector_calibration(replace(calibration, rate_hz=source.rate_hz), ids, source.rows),
        clock,
    )


def vector_monitor(
    source: ModbusVectorSettings, unit: Unit, settings: AnalysisSettings
) -> UnitMonitor:
    """The monitor of a unit with a vector rack."""
    unit = at_poll_rate(source, unit)
    transform = PollTransform(unit, source.rows, settings, source.averaging)
    return UnitMonitor(unit, settings, transform)


def fifo_source(
    source: ModbusFifoSettings, calibration: UnitCalibration, clock: Clock
) -> SampleSource:
    """Queues as a source."""
    settings = FifoSettings(
        **link_fields(source),
        poll_period_s=source.poll_period_s,
        stale_after_s=source.stale_after_s,
        loss_tolerance_s=source.loss_tolerance_s,
    )
    layout = source.fifo_layout(len(calibration.channels))
    return FifoSource(settings, layout, calibration, clock)


def slow_channels_of(slow: SlowDeviceSettings) -> frozenset[str]:
    """Slow channels that another device measures: leave them out of the source's calibration."""
    return frozenset(slow.mapped_channels)


def without_channels_of(slow: SlowDeviceSettings, calibration: UnitCalibration) -> UnitCalibration:
    """Calibration of the source that sends the waveforms."""
    return without_slow(calibration, slow_channels_of(slow))


def joined_source(
    source: SampleSource, slow: SlowDeviceSettings, calibration: UnitCalibration, clock: Clock
) -> SampleSource:
    """Waveforms of one device with slow values of another.

    Parameters
    ----------
    source
        Built with `without_channels_of` the unit's calibration.
    calibration
        Of the whole unit.
    """
    channels = only_slow(calibration, slow_channels_of(slow)).slow
    return JoinedSource(
        source, PolledSlowValues(polled_settings(slow), slow.registers, channels, clock)
    )
