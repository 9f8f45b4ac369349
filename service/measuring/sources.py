"""Where the samples of each unit come from."""

from collections.abc import Callable
from functools import partial

from acquisition.can.source import CanSource
from acquisition.clock import Clock
from acquisition.delivery.calibration import UnitCalibration
from acquisition.modbus.ring_source import RingSettings, RingSource
from acquisition.simulated.feed import SimulatedSource
from acquisition.source import SampleSource
from core.monitor.monitor import UnitMonitor
from service.measuring.registers import (
    at_poll_rate,
    fifo_source,
    joined_source,
    polled_source,
    vector_monitor,
    vector_source,
    without_channels_of,
)
from service.measuring.simulations import simulated_feed
from service.measuring.watched_unit import WatchedUnit
from service.runtime.polls import TimedSource
from service.settings.adapter_values import can_settings_of, link_fields
from service.settings.core_values import analysis_of, calibration_of, machine_of
from service.settings.plant import AnalysisModel, PlantFile
from service.settings.sources import devices
from service.settings.sources.can import CanSettings
from service.settings.units import UnitSettings

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
