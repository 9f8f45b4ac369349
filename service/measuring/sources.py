"""Sources and monitors of the units of a plant file."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

from acquisition.clock import Clock
from acquisition.modbus.fifo_source import FifoSettings, FifoSource
from acquisition.modbus.polled_source import PolledSettings, PolledSource, vector_calibration
from acquisition.modbus.ring_source import RingSettings, RingSource
from acquisition.modbus.slow_values import JoinedSource, PolledSlowValues, without_slow
from acquisition.source import SampleSource
from core.monitor.monitor import UnitMonitor
from core.samples.calibration import UnitCalibration
from core.spectra.polls import PollTransform
from service.runtime.polls import TimedSource
from service.settings.adapter_values import link_settings
from service.settings.core_values import analysis_of, calibration_of, machine_of
from service.settings.plant import AnalysisModel, PlantFile
from service.settings.sources.can import CanSettings
from service.settings.sources.devices import (
    ModbusFifoSettings,
    ModbusPolledSettings,
    ModbusRingSettings,
    ModbusVectorSettings,
    SimulatedSettings,
)
from service.settings.units import UnitSettings

DEFAULT_RETRY_S = 0.5
"""Retry period of sources that are not polled, s."""


@dataclass(frozen=True)
class WatchedUnit:
    """Sample source of a unit.

    `retry_s` is the maximum wait before a lost link is reconnected: the poll period of the source,
    so that samples arrive within two periods after the device is back.
    """

    source: SampleSource
    retry_s: float = DEFAULT_RETRY_S


QUEUE_RETRY_S = 0.25
"""Retry period of FIFO sources, s; they are polled 200 times per second."""


def watched_units(
    plant: PlantFile, source: Callable[[UnitSettings], SampleSource]
) -> dict[str, WatchedUnit]:
    """Return the source of every unit of a plant, by unit id."""
    return {unit.id: WatchedUnit(source(unit), retry_s(unit)) for unit in plant.unit}


def monitor_of(unit: UnitSettings, analysis: AnalysisModel) -> UnitMonitor:
    """Return the monitor of a unit from its settings in the plant file.

    With source kind "modbus_polled" a poll is a sample; with "modbus_vector" it is a set of
    vectors.
    """
    machine, settings = machine_of(unit), analysis_of(analysis)
    match unit.source:
        case ModbusVectorSettings() as source:
            machine = replace(machine, rate_hz=source.rate_hz)
            transform = PollTransform(machine, source.rows, settings, source.averaging)
            return UnitMonitor(machine, settings, transform)
        case ModbusPolledSettings() as source:
            return UnitMonitor(replace(machine, rate_hz=source.rate_hz), settings)
        case _:
            return UnitMonitor(machine, settings)


def live_units(plant: PlantFile, clock: Clock) -> dict[str, WatchedUnit]:
    """Return the sources, with measured poll durations, by unit id."""
    return watched_units(plant, lambda unit: TimedSource(partial(source_of, unit), clock))


def retry_s(unit: UnitSettings) -> float:
    """Return the maximum wait before a lost link of a unit is reconnected, s."""
    if isinstance(unit.source, ModbusFifoSettings):
        return QUEUE_RETRY_S
    period_s: float = getattr(unit.source, "poll_period_s", DEFAULT_RETRY_S)
    return period_s


def source_of(unit: UnitSettings, clock: Clock) -> SampleSource:
    """Return the sample source of a unit, joined with its slow source if configured."""
    calibration, slow = calibration_of(unit), unit.slow_source
    if slow is None:
        return _main_source(unit, calibration, clock)
    ids = frozenset(slow.mapped_channels)
    channels = [channel for channel in calibration.slow if channel.id in ids]
    return JoinedSource(
        _main_source(unit, without_slow(calibration, ids), clock),
        PolledSlowValues(link_settings(PolledSettings, slow), slow.registers, channels, clock),
    )


def _main_source(unit: UnitSettings, calibration: UnitCalibration, clock: Clock) -> SampleSource:
    ids = [channel.id for channel in unit.channel]
    match unit.source:
        case CanSettings() as source:
            from acquisition.can.source import CanSource  # slow imports, only for such a plant
            from service.settings.can_values import can_settings_of

            return CanSource(can_settings_of(unit, source), calibration, clock)
        case SimulatedSettings():
            from acquisition.simulated.feed import SimulatedSource
            from service.measuring.simulated_sources import simulated_feed

            return SimulatedSource(simulated_feed(unit, clock), calibration, clock)
        case ModbusPolledSettings() | ModbusVectorSettings() as source:
            calibration = replace(calibration, rate_hz=source.rate_hz)
            if isinstance(source, ModbusVectorSettings):
                calibration = vector_calibration(calibration, ids, source.rows)
                ids = [row.id for row in source.rows]
            settings = link_settings(PolledSettings, source)
            return PolledSource(settings, source.registers, ids, calibration, clock)
        case ModbusRingSettings() as source:
            return RingSource(link_settings(RingSettings, source), calibration, clock)
        case ModbusFifoSettings() as source:
            fifo = link_settings(FifoSettings, source)
            return FifoSource(fifo, source.fifo_layout(len(ids)), calibration, clock)
