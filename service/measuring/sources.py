"""Sources and monitors of the units of a plant file."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

from acquisition.can.source import CanSource
from acquisition.clock import Clock
from acquisition.delivery.joined import JoinedSource, only_slow, without_slow
from acquisition.modbus.fifo_source import FifoSettings, FifoSource
from acquisition.modbus.polled_source import PolledSettings, PolledSource, vector_calibration
from acquisition.modbus.ring_source import RingSettings, RingSource
from acquisition.modbus.slow_values import PolledSlowValues
from acquisition.simulated.feed import SimulatedSource
from acquisition.source import SampleSource
from core.machine.unit import Unit
from core.monitor.assessment import AnalysisSettings
from core.monitor.monitor import UnitMonitor
from core.samples.calibration import UnitCalibration
from core.spectra.polls import PollTransform
from service.measuring.simulated_sources import simulated_feed
from service.runtime.polls import TimedSource
from service.settings.adapter_values import can_settings_of, link_fields
from service.settings.core_values import analysis_of, calibration_of, machine_of
from service.settings.plant import AnalysisModel, PlantFile
from service.settings.sources import devices
from service.settings.sources.can import CanSettings
from service.settings.sources.devices import (
    MappedDeviceSettings,
    ModbusFifoSettings,
    ModbusPolledSettings,
    ModbusVectorSettings,
    SlowDeviceSettings,
)
from service.settings.units import UnitSettings


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


@dataclass(frozen=True)
class WatchedUnit:
    """A unit's source and the monitor that its blocks go to.

    Parameters
    ----------
    retry_s
        Longest wait before a lost link is tried again: the source's poll period, so that the first
        sample is here within two of them after the device is back.
    """

    source: SampleSource
    monitor: UnitMonitor
    retry_s: float = 0.5


DEFAULT_RETRY_S = 0.5
"""Of sources that are not polled."""

QUEUE_RETRY_S = 0.25
"""A queue is looked at 200 times a second; its device, when it is away, is not to be called so."""


def watched_units(
    plant: PlantFile, source: Callable[[UnitSettings], SampleSource]
) -> dict[str, WatchedUnit]:
    """Source and monitor of every unit of a plant."""
    return {
        unit.id: WatchedUnit(source(unit), monitor_of(unit, plant.analysis), retry_s(unit))
        for unit in plant.unit
    }


def monitor_of(unit: UnitSettings, analysis: AnalysisModel) -> UnitMonitor:
    """What the samples of a unit are analysed by: its rack may give vectors instead of them."""
    machine, settings, source = machine_of(unit), analysis_of(analysis), unit.source
    match source:
        case devices.ModbusVectorSettings():
            return vector_monitor(source, machine, settings)
        case devices.ModbusPolledSettings():
            return UnitMonitor(at_poll_rate(source, machine), settings)
        case _:
            return UnitMonitor(machine, settings)


def live_units(plant: PlantFile, clock: Clock) -> dict[str, WatchedUnit]:
    """All units with the sources that the plant file names."""
    return watched_units(plant, lambda unit: TimedSource(partial(source_of, unit), clock))


def vector_rows(plant: PlantFile) -> dict[str, list[str]]:
    """Which channel each row of a block is about, for units that give vectors."""
    return {
        unit.id: [row.channel for row in unit.source.rows]
        for unit in plant.unit
        if isinstance(unit.source, devices.ModbusVectorSettings)
    }


def retry_s(unit: UnitSettings) -> float:
    """How soon a unit's lost link is tried again: as often as it is looked at, but no storm."""
    if isinstance(unit.source, devices.ModbusFifoSettings):
        return QUEUE_RETRY_S
    period_s: float = getattr(unit.source, "poll_period_s", DEFAULT_RETRY_S)
    return period_s


def source_of(unit: UnitSettings, clock: Clock) -> SampleSource:
    """Where the samples of a unit come from, and its slow values, if from elsewhere."""
    calibration, beside = calibration_of(unit), unit.slow_source
    if beside is None:
        return _main_source(unit, calibration, clock)
    source = _main_source(unit, without_channels_of(beside, calibration), clock)
    return joined_source(source, beside, calibration, clock)


def _main_source(unit: UnitSettings, calibration: UnitCalibration, clock: Clock) -> SampleSource:
    source = unit.source
    match source:
        case devices.ModbusRingSettings():
            return RingSource(_ring_settings(source), calibration, clock)
        case devices.ModbusFifoSettings():
            return fifo_source(source, calibration, clock)
        case devices.ModbusPolledSettings():
            return polled_source(source, machine_of(unit), calibration, clock)
        case devices.ModbusVectorSettings():
            return vector_source(source, machine_of(unit), calibration, clock)
        case CanSettings():
            return CanSource(can_settings_of(unit, source), calibration, clock)
        case devices.SimulatedSettings():
            return SimulatedSource(simulated_feed(unit, clock), calibration, clock)


def _ring_settings(source: devices.ModbusRingSettings) -> RingSettings:
    return RingSettings(
        **link_fields(source),
        function=source.function,
        base_address=source.base_address,
        poll_period_s=source.poll_period_s,
        stale_after_s=source.stale_after_s,
    )
