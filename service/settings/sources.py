"""Where the samples of a unit come from: one model for each kind of source."""

from typing import Annotated, Literal

from pydantic import Field

from service.settings.base import Settings
from service.settings.can import CanSettings
from service.settings.modbus_link import ModbusLinkSettings
from service.settings.modbus_sources import (
    ModbusFifoSettings,
    ModbusPolledSettings,
    ModbusVectorSettings,
)


class ModbusRingSettings(ModbusLinkSettings):
    """A streaming DAQ with a block ring, over Modbus TCP or RTU."""

    kind: Literal["modbus_ring"]
    """This source's kind."""

    base_address: Annotated[int, Field(ge=0, le=65520)] = 0
    """Address of the profile's header, counted from 0."""

    function: Literal[3, 4] = 3
    """Function code that reads the registers: 3 (holding) or 4 (input)."""

    poll_period_s: Annotated[float, Field(ge=0.01, le=60.0)] = 0.25
    """Longest time between looks at the ring in seconds; the ring must hold several of them. It is
    looked at a little sooner, out of step with its slots, which shows how fast the DAQ samples."""

    stale_after_s: Annotated[float, Field(ge=0.1, le=3600.0)] = 3.0
    """A DAQ whose newest slot stands still for this long counts as not connected."""


class SimulatedSettings(Settings):
    """The unit's simulation read in this process, without any wire."""

    kind: Literal["simulated"]
    """This source's kind."""


SourceSettings = Annotated[
    ModbusRingSettings
    | ModbusFifoSettings
    | ModbusPolledSettings
    | ModbusVectorSettings
    | CanSettings
    | SimulatedSettings,
    Field(discriminator="kind"),
]
