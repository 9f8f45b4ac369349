"""A generating unit in the plant file: its bearings, channels and where its samples come from."""

from collections.abc import Iterable
from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from core.samples.calibration import BLOCK_SAMPLES
from service.settings.alarm_fit import require_alarm_fit
from service.settings.base import Identifier, MisfitError, Settings, refuse_twice
from service.settings.bearings import (
    CHANNEL_KEYS,
    GAP_KEYS,
    OPTIONAL_CHANNEL_KEYS,
    BearingSettings,
)
from service.settings.channels import ChannelSettings, SlowChannelSettings, Transducer
from service.settings.modbus_sources import (
    ModbusPolledSettings,
    ModbusVectorSettings,
    SlowDeviceSettings,
)
from service.settings.simulation import SimulationSettings
from service.settings.source_fit import require_source_fit
from service.settings.sources import SimulatedSettings, SourceSettings


class UnitSettings(Settings):
    """A generating unit."""

    id: Identifier
    """Unique within the plant; example: "U07"."""

    name: Annotated[str, StringConstraints(min_length=1, max_length=80)]
    """As people call it; example: "Unit 7"."""

    rated_speed_rpm: Annotated[float, Field(ge=20.0, le=1500.0)]
    """Rated running speed in r/min, 20 to 1500; example: 92.3."""

    rated_power_mw: Annotated[float, Field(gt=0.0, le=2000.0)] | None = None
    """Rated active power in MW, at most 2000; with it and power_channel, operating states are told
    apart, films compared under like conditions, and changes of load judged as a share of it.
    Example: 700.0."""

    rate_hz: Annotated[float, Field(ge=20.0, le=100_000.0)] = 600.0
    """Samples per second and channel; example: 600.0. Without effect where registers are polled:
    there it is one over poll_period_s."""

    block_samples: Annotated[int, Field(ge=1, le=10_000)] = BLOCK_SAMPLES
    """Samples of each channel that share one verdict on the channel and one set of slow values; a
    DAQ's slots should be as long. Example: 50, a twelfth of a second at 600 Hz."""

    turbine: Literal["francis", "kaplan"] = "francis"
    """"francis" or "kaplan". A Kaplan turbine has no part-load vortex: that order is off."""

    rotation: Literal["x_to_y", "y_to_x"] = "x_to_y"
    """Which way the shaft turns, seen in the bearings' axes: "x_to_y" or "y_to_x". An orbit that
    turns the other way is a sign of exchanged transducers."""

    speed_channel: Identifier | None = None
    """Slow channel (r/min) of the running speed; without it and a key-phase, the 1× line
    is used."""

    key_phase: Identifier | None = None
    """Waveform channel with one pulse a turn (transducer "key_phase"): it gives the running speed,
    and the shaft's angle that slow_roll needs; example: "kp"."""

    power_channel: Identifier | None = None
    """Slow channel (MW) of the active power. While it has no value, results are uncertain
    (power_unknown); without it a unit counts as steady by its speed alone."""

    source: SourceSettings
    """Where the samples come from, by kind: "modbus_ring" (a streaming DAQ), "modbus_fifo"
    (queues), "modbus_polled" (registers), "modbus_vector" (a rack that gives amplitudes) or
    "can" or "simulated"."""

    slow_source: SlowDeviceSettings | None = None
    """A second device that slow channels are polled from, where the first has none."""

    channel: Annotated[tuple[ChannelSettings, ...], Field(min_length=1, max_length=32)]
    """Waveform channels in wire order, at most 32."""

    slow_channel: Annotated[tuple[SlowChannelSettings, ...], Field(max_length=50)] = ()
    """Slow channels in wire order, at most 50."""

    bearing: Annotated[tuple[BearingSettings, ...], Field(min_length=1, max_length=8)]
    """Guide bearings."""

    simulation: SimulationSettings | None = None
    """The simulated machine behind a simulated DAQ or source; no effect on a real one."""

    @property
    def sampling_hz(self) -> float:
        """Samples of each channel in a second: polls, where registers are polled."""
        if isinstance(self.source, ModbusPolledSettings | ModbusVectorSettings):
            return self.source.rate_hz
        return self.rate_hz

    @model_validator(mode="after")
    def _check(self) -> Self:
        refuse_twice(("channel", n, "id", channel.id) for n, channel in enumerate(self.channel))
        taken = {channel.id for channel in self.channel}
        for n, slow in enumerate(self.slow_channel):
            if slow.id in taken:
                raise MisfitError("is the id of a waveform channel", "slow_channel", n, "id")
        refuse_twice(("slow_channel", n, "id", slow.id) for n, slow in enumerate(self.slow_channel))
        refuse_twice(("bearing", n, "id", bearing.id) for n, bearing in enumerate(self.bearing))
        for n, bearing in enumerate(self.bearing):
            self._check_channels(n, bearing)
            self._check_slow(bearing.oil_temperature, "degC", "bearing", n, "oil_temperature")
            for key in GAP_KEYS:
                self._check_slow(getattr(bearing, key), "mm", "bearing", n, key)
        self._check_key_phase()
        self._check_slow(self.speed_channel, "r/min", "speed_channel")
        self._check_slow(self.power_channel, "MW", "power_channel")
        self._check_simulation()
        slow_ids = [channel.id for channel in self.slow_channel]
        channel_ids = [channel.id for channel in self.channel]
        require_source_fit(self.source, self.slow_source, channel_ids, slow_ids)
        require_alarm_fit(self.id, self.source, self.key_phase, self.channel, self.bearing)
        return self

    def _check_channels(self, number: int, bearing: BearingSettings) -> None:
        known = [channel.id for channel in self.channel]
        keys = [*CHANNEL_KEYS, *(k for k in OPTIONAL_CHANNEL_KEYS if getattr(bearing, k))]
        used = [(key, getattr(bearing, key)) for key in keys]
        for key, id_ in used:
            if id_ not in known:
                raise MisfitError(_not_among(known), "bearing", number, key)
            if id_ in self._key_phases():
                raise MisfitError("is a key_phase channel, no vibration", "bearing", number, key)
        refuse_twice(("bearing", number, key, id_) for key, id_ in used)

    def _key_phases(self) -> list[str]:
        return [c.id for c in self.channel if c.transducer is Transducer.KEY_PHASE]

    def _check_key_phase(self) -> None:
        if self.key_phase is not None and self.key_phase not in self._key_phases():
            words = ", ".join(self._key_phases()) or "none"
            raise MisfitError(
                f'needs a channel with transducer "key_phase"; there is {words}', "key_phase"
            )

    def _check_slow(self, id_: str | None, unit: str, *at: int | str) -> None:
        units = {channel.id: channel.unit for channel in self.slow_channel}
        if id_ is not None and id_ not in units:
            raise MisfitError(_not_among(units), *at)
        if id_ is not None and units[id_] != unit:
            raise MisfitError(f"is a slow channel in {units[id_]}, needed is one in {unit}", *at)

    def _check_simulation(self) -> None:
        simulation = self.simulation
        if simulation is None:
            if isinstance(self.source, SimulatedSettings):
                raise MisfitError("needs a [unit.simulation] table", "source", "kind")
            return
        names = [bearing.bearing for bearing in simulation.bearing] or ["UJB", "LJB", "TJB"]
        for number, bearing in enumerate(self.bearing):
            if bearing.id not in names:
                allowed = " or ".join(names)
                raise MisfitError(f"a simulated bearing is {allowed}", "bearing", number, "id")
        cutoff_hz = simulation.hydraulic_cutoff_hz
        if cutoff_hz is not None and cutoff_hz >= self.rate_hz / 2:
            limit = f"must be below half the sampling rate, {self.rate_hz / 2:g} Hz"
            raise MisfitError(limit, "simulation", "hydraulic_cutoff_hz")


def _not_among(known: Iterable[str]) -> str:
    return f"no such channel; there are {', '.join(known) or 'none'}"
