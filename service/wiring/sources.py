"""Where the samples of each unit come from."""

from collections.abc import Callable

from acquisition.clock import Clock
from acquisition.modbus.ring_source import ModbusRingSettings, ModbusRingSource
from acquisition.simulated.source import SimulatedSource
from acquisition.source import SampleSource
from core.monitor import UnitMonitor
from core.monitor_port import Monitor
from core.vector_monitor import VectorMonitor
from service.conversion import analysis_of, calibration_of, machine_of
from service.runner import WatchedUnit
from service.settings import modbus_sources, sources
from service.settings.plant import AnalysisModel, PlantFile
from service.settings.units import UnitSettings
from service.wiring.modbus import (
    fields_of,
    fifo_source,
    polled_source,
    transport_of,
    vector_source,
    with_slow_source,
)
from service.wiring.simulations import simulated_feed

DEFAULT_RETRY_S = 0.5
"""Of sources that are not polled."""


def watched_units(
    plant: PlantFile, source: Callable[[UnitSettings], SampleSource]
) -> dict[str, WatchedUnit]:
    """Source and monitor of every unit of a plant."""
    return {
        unit.id: WatchedUnit(source(unit), monitor_of(unit, plant.analysis), poll_period_s(unit))
        for unit in plant.unit
    }


def monitor_of(unit: UnitSettings, analysis: AnalysisModel) -> Monitor:
    """What the samples of a unit are analysed by: its rack may give vectors instead of them."""
    machine, settings, source = machine_of(unit), analysis_of(analysis), unit.source
    if isinstance(source, modbus_sources.ModbusVectorSettings):
        return VectorMonitor(machine, source.rows, settings, source.averaging)
    return UnitMonitor(machine, settings)


def live_units(plant: PlantFile, clock: Clock) -> dict[str, WatchedUnit]:
    """All units with the sources that the plant file names."""
    return watched_units(plant, lambda unit: source_of(unit, clock))


def vector_rows(plant: PlantFile) -> dict[str, list[str]]:
    """Which channel each row of a block is about, for units that give vectors."""
    return {
        unit.id: [row.channel for row in unit.source.rows]
        for unit in plant.unit
        if isinstance(unit.source, modbus_sources.ModbusVectorSettings)
    }


def poll_period_s(unit: UnitSettings) -> float:
    """How often a unit's source is looked at; a lost link is tried again as often."""
    period_s: float = getattr(unit.source, "poll_period_s", DEFAULT_RETRY_S)
    return period_s


def source_of(unit: UnitSettings, clock: Clock) -> SampleSource:
    """Where the samples of a unit come from."""
    return with_slow_source(_main_source(unit, clock), unit, clock)


def _main_source(unit: UnitSettings, clock: Clock) -> SampleSource:
    source = unit.source
    match source:
        case sources.ModbusRingSettings():
            ring = ModbusRingSettings(transport=transport_of(source), **fields_of(source))
            return ModbusRingSource(ring, calibration_of(unit), clock)
        case modbus_sources.ModbusFifoSettings():
            return fifo_source(source, unit, clock)
        case modbus_sources.ModbusPolledSettings():
            return polled_source(source, unit, clock)
        case modbus_sources.ModbusVectorSettings():
            return vector_source(source, unit, clock)
        case sources.SimulatedSettings():
            feed = simulated_feed(unit, clock)
            return SimulatedSource(feed, calibration_of(unit), clock)
