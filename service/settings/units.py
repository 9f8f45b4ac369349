"""A generating unit in the plant file: its bearings, channels and where its samples come from."""

from collections.abc import Iterable, Sequence
from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from service.settings.base import Identifier, Settings
from service.settings.channels import ChannelSettings, SlowChannelSettings
from service.settings.simulation import SimulationSettings

MicrometrePair = tuple[
    Annotated[float, Field(gt=0.0, le=10_000.0)], Annotated[float, Field(gt=0.0, le=10_000.0)]
]


class BearingSettings(Settings):
    """A guide bearing: its bracket, its clearance and the channels that watch it."""

    id: Identifier
    """Unique within the unit: "UJB", "LJB", "TJB" for upper, lower and turbine journal bearing."""

    bracket_stiffness_n_per_m: Annotated[float, Field(ge=1e7, le=1e12)]
    """Radial stiffness of the bracket in N/m, between 1e7 and 1e12; example: 1.18e9. Every result
    of equation (5) is proportional to it."""

    clearance_um: Annotated[float, Field(ge=20.0, le=5000.0)]
    """Radial clearance in operation in µm, 20 to 5000; example: 200.0."""

    gap_reference_um: MicrometrePair
    """Probe gaps [x, y] in µm with the shaft centred; example: [2000.0, 1950.0]."""

    shaft_x: Identifier
    """Channel of the shaft's relative vibration in x."""

    shaft_y: Identifier
    """Channel of the shaft's relative vibration in y."""

    bearing_x: Identifier
    """Channel of the bearing's absolute vibration in x."""

    bearing_y: Identifier
    """Channel of the bearing's absolute vibration in y."""

    oil_temperature: Identifier | None = None
    """Slow channel (degC) of the oil temperature, if measured."""

    gap_x: Identifier | None = None
    """Slow channel (mm) of the x gap; without it the mean of a proximity probe is the gap."""

    gap_y: Identifier | None = None
    """Slow channel (mm) of the y gap."""


class ModbusRingSettings(Settings):
    """A streaming DAQ over Modbus TCP, block-ring profile v1."""

    kind: Literal["modbus_ring"]
    """This source's kind."""

    host: Annotated[str, StringConstraints(min_length=1, max_length=253)]
    """Address or name of the DAQ; example: "192.0.2.17"."""

    port: Annotated[int, Field(ge=0, le=65535)] = 502
    """TCP port; example: 502. 0 only for a simulated DAQ, which then takes a free one."""

    device_id: Annotated[int, Field(ge=1, le=255)] = 1
    """Modbus unit identifier, 1 to 255."""

    base_address: Annotated[int, Field(ge=0, le=65520)] = 0
    """Address of the profile's header, counted from 0."""

    function: Literal[3, 4] = 3
    """Function code that reads the registers: 3 (holding) or 4 (input)."""

    timeout_s: Annotated[float, Field(ge=0.05, le=60.0)] = 1.0
    """Longest wait for one reply in seconds, 0.05 to 60."""

    poll_period_s: Annotated[float, Field(ge=0.01, le=60.0)] = 0.25
    """Time between looks at the ring in seconds; the ring must hold several of them."""

    stale_after_s: Annotated[float, Field(ge=0.1, le=3600.0)] = 3.0
    """A DAQ whose newest slot stands still for this long counts as not connected."""


class SimulatedSettings(Settings):
    """The unit's simulation read in this process, without any wire."""

    kind: Literal["simulated"]
    """This source's kind."""

    samples_per_block: Annotated[int, Field(ge=1, le=100_000)] = 60
    """Samples per channel in one block."""


SourceSettings = Annotated[ModbusRingSettings | SimulatedSettings, Field(discriminator="kind")]


class UnitSettings(Settings):
    """A generating unit."""

    id: Identifier
    """Unique within the plant; example: "U07"."""

    name: Annotated[str, StringConstraints(min_length=1, max_length=80)]
    """As people call it; example: "Unit 7"."""

    rated_speed_rpm: Annotated[float, Field(ge=20.0, le=1500.0)]
    """Rated running speed in r/min, 20 to 1500; example: 92.3."""

    rate_hz: Annotated[float, Field(ge=20.0, le=100_000.0)] = 600.0
    """Samples per second and channel; example: 600.0."""

    speed_channel: Identifier | None = None
    """Slow channel (r/min) of the running speed; without it the 1× line is used."""

    power_channel: Identifier | None = None
    """Slow channel (MW) of the active power."""

    source: SourceSettings
    """Where the samples come from: kind "modbus_ring" or "simulated"."""

    channel: Annotated[tuple[ChannelSettings, ...], Field(min_length=1, max_length=32)]
    """Waveform channels in wire order, at most 32."""

    slow_channel: Annotated[tuple[SlowChannelSettings, ...], Field(max_length=50)] = ()
    """Slow channels in wire order, at most 50."""

    bearing: Annotated[tuple[BearingSettings, ...], Field(min_length=1, max_length=8)]
    """Guide bearings."""

    simulation: SimulationSettings | None = None
    """The simulated machine behind a simulated DAQ or source; no effect on a real one."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        _refuse_duplicates(
            "channel id", [*(c.id for c in self.channel), *(c.id for c in self.slow_channel)]
        )
        _refuse_duplicates("bearing id", [b.id for b in self.bearing])
        waveforms = [channel.id for channel in self.channel]
        for bearing in self.bearing:
            used = [bearing.shaft_x, bearing.shaft_y, bearing.bearing_x, bearing.bearing_y]
            _refuse_unknown(f"bearing {bearing.id}", used, waveforms)
            _refuse_duplicates(f"channel of bearing {bearing.id}", used)
            self._check_slow(f"bearing {bearing.id}", bearing.oil_temperature, "degC")
            self._check_slow(f"bearing {bearing.id}", bearing.gap_x, "mm")
            self._check_slow(f"bearing {bearing.id}", bearing.gap_y, "mm")
        self._check_slow("speed_channel", self.speed_channel, "r/min")
        self._check_slow("power_channel", self.power_channel, "MW")
        if isinstance(self.source, SimulatedSettings) and self.simulation is None:
            raise ValueError('source kind "simulated" needs a [unit.simulation] table')
        return self

    def _check_slow(self, where: str, id_: str | None, unit: str) -> None:
        if id_ is None:
            return
        units = {channel.id: channel.unit for channel in self.slow_channel}
        _refuse_unknown(where, [id_], list(units))
        if units[id_] != unit:
            raise ValueError(f'{where} uses slow channel "{id_}" in {units[id_]}, needs {unit}')


def _refuse_duplicates(what: str, ids: Iterable[str]) -> None:
    seen: set[str] = set()
    for id_ in ids:
        if id_ in seen:
            raise ValueError(f'{what} "{id_}" is used twice; each must be unique')
        seen.add(id_)


def _refuse_unknown(where: str, used: Sequence[str], known: Sequence[str]) -> None:
    for id_ in used:
        if id_ not in known:
            raise ValueError(
                f'{where} names channel "{id_}", which is not among {", ".join(known) or "none"}'
            )
