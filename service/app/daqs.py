"""Simulated DAQs in front of any raw feed, where the unit's source looks for them."""

from acquisition.clock import Clock
from acquisition.simulated.devices.ring_device import RingDevice, RingDeviceSettings
from acquisition.simulated.devices.server import DaqServer
from acquisition.simulated.feed import SampleFeed
from service.app.register_daqs import fifo_device, modbus_server, polled_device, vector_device
from service.settings import modbus_sources, sources
from service.settings.can import CanSettings
from service.settings.can_devices import can_daq_of
from service.settings.core_values import calibration_of, machine_of
from service.settings.units import UnitSettings


def daq_of(
    unit: UnitSettings, feed: SampleFeed, clock: Clock | None, *, recorded: bool
) -> DaqServer:
    """A DAQ of the kind that a unit's source reads.

    Parameters
    ----------
    clock
        Paces the device; without one it produces as fast as its reader reads.
    recorded
        Whether nothing of the feed must be lost, so that the device waits for its reader.

    Raises
    ------
    ConfigError
        If what it should serve does not fit into such a device.
    LookupError
        If the unit's source reads no device.
    """
    source, machine = unit.source, machine_of(unit)
    on_demand = clock is None
    match source:
        case sources.ModbusRingSettings():
            device = RingDevice(feed, unit.id, _ring_shape(unit, source))
            device.on_demand, device.patient = on_demand, recorded
            return modbus_server(device, source, clock, patient=recorded)
        case modbus_sources.ModbusFifoSettings():
            queue = fifo_device(source, machine, feed, on_demand=on_demand)
            return modbus_server(queue, source, clock, patient=recorded)
        case modbus_sources.ModbusPolledSettings():
            registers = polled_device(
                source, machine, calibration_of(unit), feed, on_demand=on_demand
            )
            return modbus_server(registers, source, clock, patient=recorded)
        case modbus_sources.ModbusVectorSettings():
            rack = vector_device(source, machine, calibration_of(unit), feed, on_demand=on_demand)
            return modbus_server(rack, source, clock, patient=recorded)
        case CanSettings():
            return can_daq_of(unit, source, feed, clock, patient=recorded)
        case sources.SimulatedSettings():
            raise LookupError(f'the source of unit {unit.id} is of kind "simulated": no DAQ')


def _ring_shape(unit: UnitSettings, source: sources.ModbusRingSettings) -> RingDeviceSettings:
    """The ring that the unit's simulation asks for; of slots as long as its blocks otherwise."""
    if unit.simulation is None:
        return RingDeviceSettings(
            base_address=source.base_address, samples_per_slot=unit.block_samples
        )
    return RingDeviceSettings(
        base_address=source.base_address,
        samples_per_slot=unit.simulation.samples_per_slot,
        n_slots=unit.simulation.n_slots,
    )
