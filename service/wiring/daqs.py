"""Simulated DAQs in front of any raw feed, where the unit's source looks for them."""

from pathlib import Path

from acquisition.clock import Clock
from acquisition.daq.port import DaqServer
from acquisition.daq.ring_device import RingDevice
from acquisition.daq.ring_server import ModbusRingServer, RtuRingServer
from acquisition.daq.ring_shape import RingDeviceSettings
from acquisition.raw import RawFeed
from service.settings import sources
from service.settings.units import UnitSettings


def daq_of(unit: UnitSettings, feed: RawFeed, clock: Clock | None, *, recorded: bool) -> DaqServer:
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
    source = unit.source
    waiting = {"on_demand": clock is None, "patient": recorded}
    match source:
        case sources.ModbusRingSettings():
            device = RingDevice(feed, unit.id, _ring_shape(unit, source))
            if source.host is not None:
                return ModbusRingServer(device, clock, source.host, source.port, **waiting)
            return RtuRingServer(device, clock, _line(source.device), **waiting)
        case _:
            raise LookupError(f"there is no simulated DAQ for unit {unit.id}'s {source.kind}")


def _line(device: str | None) -> Path | None:
    """Where a pseudo-terminal is to be found; "pty" leaves that to the system."""
    return None if device in (None, "pty") else Path(device)


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
