"""The wires over which a unit's samples can be played on loopback, whatever its own source is."""

from enum import StrEnum

from service.settings.can import CanSettings
from service.settings.plant import PlantFile
from service.settings.sources import ModbusRingSettings, SourceSettings

_LOOPBACK = "127.0.0.1"


STALE_AFTER_S = 5.0
"""Silence that ends a run that is over; one that is busy with its start is not."""


class Wire(StrEnum):
    """A protocol and what carries it."""

    MODBUS_TCP = "modbus_tcp"
    MODBUS_RTU = "modbus_rtu"
    CAN = "can"
    CAN_FD = "can_fd"


def over_wire(plant: PlantFile, wire: Wire) -> PlantFile:
    """The plant with all units behind DAQs on this wire, where no DAQ has said yet where it is."""
    units = tuple(
        # where a sample is a poll, the rate of the recording is that of the polls
        unit.model_copy(update={"source": _source(wire), "rate_hz": unit.sampling_hz})
        for unit in plant.unit
    )
    return plant.model_copy(update={"unit": units})


def _source(wire: Wire) -> SourceSettings:
    """Polls follow each other quickly: how long a replay takes is a matter of its speed."""
    if wire in (Wire.CAN, Wire.CAN_FD):
        return CanSettings(
            kind="can",
            interface="slcan",
            channel=f"socket://{_LOOPBACK}:0",
            fd=wire is Wire.CAN_FD,
            profile="padwatch_int16",
            stale_after_s=STALE_AFTER_S,
            when_full="wait",
        )
    where = {"host": _LOOPBACK, "port": 0} if wire is Wire.MODBUS_TCP else {"device": "pty"}
    return ModbusRingSettings(
        kind="modbus_ring", **where, poll_period_s=0.02, timeout_s=2.0, stale_after_s=STALE_AFTER_S
    )
