"""Simulated DAQs in front of any raw feed."""

from acquisition.clock import Clock
from acquisition.daq.ring_device import RingDevice, RingDeviceSettings
from acquisition.daq.ring_server import ModbusRingServer
from service.settings import sources
from service.settings.units import UnitSettings
from service.wiring.simulations import simulated_feed, simulation_of


def simulated_daq(unit: UnitSettings, clock: Clock) -> ModbusRingServer:
    """A Modbus TCP DAQ with the simulated machine of a unit behind it, where its source looks.

    Raises
    ------
    LookupError
        If the unit has no simulation, or its source is no Modbus ring.
    """
    source = unit.source
    if not isinstance(source, sources.ModbusRingSettings):
        raise LookupError(f'the source of unit {unit.id} is not of kind "modbus_ring"')
    simulation = simulation_of(unit)
    shape = RingDeviceSettings(
        base_address=source.base_address,
        samples_per_slot=simulation.samples_per_slot,
        n_slots=simulation.n_slots,
    )
    device = RingDevice(simulated_feed(unit, clock), unit.id, shape)
    return ModbusRingServer(device, clock, source.host, source.port)
