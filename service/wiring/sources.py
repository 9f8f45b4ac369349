"""Where the samples of each unit come from."""

from collections.abc import Mapping

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


def watched_units(plant: PlantFile, clock: Clock) -> Mapping[str, WatchedUnit]:
    """Source and monitor of every unit of a plant."""
    analysis = analysis_of(plant.analysis)
    return {
        unit.id: WatchedUnit(source_of(unit, clock), UnitMonitor(machine_of(unit), analysis))
        for unit in plant.unit
    }


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
