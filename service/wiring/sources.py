"""Where the samples of each unit come from."""

from collections.abc import Callable

from acquisition.clock import Clock
from acquisition.modbus.ring_source import ModbusRingSettings, ModbusRingSource
from acquisition.simulated.source import SimulatedSource
from acquisition.source import SampleSource
from core.monitor import UnitMonitor
from service.conversion import analysis_of, calibration_of, machine_of
from service.runner import WatchedUnit
from service.settings import sources
from service.settings.plant import PlantFile
from service.settings.units import UnitSettings
from service.wiring.modbus import fields_of, transport_of
from service.wiring.simulations import simulated_feed

DEFAULT_RETRY_S = 0.5
"""Of sources that are not polled."""


def watched_units(
    plant: PlantFile, source: Callable[[UnitSettings], SampleSource]
) -> dict[str, WatchedUnit]:
    """Source and monitor of every unit of a plant."""
    analysis = analysis_of(plant.analysis)
    return {
        unit.id: WatchedUnit(
            source(unit), UnitMonitor(machine_of(unit), analysis), poll_period_s(unit)
        )
        for unit in plant.unit
    }


def live_units(plant: PlantFile, clock: Clock) -> dict[str, WatchedUnit]:
    """All units with the sources that the plant file names."""
    return watched_units(plant, lambda unit: source_of(unit, clock))


def poll_period_s(unit: UnitSettings) -> float:
    """How often a unit's source is looked at; a lost link is tried again as often."""
    period_s: float = getattr(unit.source, "poll_period_s", DEFAULT_RETRY_S)
    return period_s


def source_of(unit: UnitSettings, clock: Clock) -> SampleSource:
    """Where the samples of a unit come from."""
    source = unit.source
    match source:
        case sources.ModbusRingSettings():
            ring = ModbusRingSettings(transport=transport_of(source), **fields_of(source))
            return ModbusRingSource(ring, calibration_of(unit), clock)
        case sources.SimulatedSettings():
            feed = simulated_feed(unit, clock)
            return SimulatedSource(feed, calibration_of(unit), clock)
