"""Settings of a generating unit; checks that source, channels and alarms are consistent."""

import math
from collections.abc import Iterable
from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from core.alarms.alarm import PLANT
from core.samples.calibration import BLOCK_SAMPLES
from core.spectra.resolution import USUAL_DEG, angles_of
from service.settings.alarms import BearingAlarmSettings
from service.settings.base import Identifier, MisfitError, Settings, refuse_twice
from service.settings.bearings import CHANNEL_KEYS, GAP_KEYS, OPTIONAL_CHANNEL_KEYS, BearingSettings
from service.settings.channels import ChannelSettings, SlowChannelSettings, Transducer
from service.settings.sources.can import CanSettings
from service.settings.sources.devices import (
    ModbusFifoSettings,
    ModbusPolledSettings,
    ModbusVectorSettings,
    SimulatedSettings,
    SlowDeviceSettings,
    SourceSettings,
)
from service.settings.sources.modbus import ModbusLinkSettings
from service.settings.sources.simulated import SimulationSettings


def require_lines_apart(readers: Iterable[tuple[tuple[int | str, ...], object]]) -> None:
    """Raise `MisfitError` if two devices are on one serial line, since a line has one master.

    ``readers`` are pairs of the location in the plant file and the settings of each device.
    """
    taken: dict[str, tuple[int | str, ...]] = {}
    for at, device in readers:
        if not isinstance(device, ModbusLinkSettings) or device.device in (None, "pty"):
            continue
        line = str(device.device)
        if line in taken:
            _, number, key = taken[line]
            raise MisfitError(
                f"is already used by {key} of unit[{int(number) + 1}]; a serial line has one"
                " master, so use another line, or a gateway with host",
                *at,
                "device",
            )
        taken[line] = at


FROM_WAVEFORMS = ("shaft_overall_um_pp", "bearing_overall_mm_s_rms")
"""Keys of the limits of broad-band quantities, which a rack that sends vectors does not report."""

ZONES = ("shaft_um_pp", "shaft_max_um_pk", "bearing_mm_s_rms")


def _require_no_waveforms(alarms: BearingAlarmSettings, at: tuple[str | int, ...]) -> None:
    words = 'requires waveforms, which a source of kind "modbus_vector" lacks; remove it'
    for table, keys, place in ((alarms, FROM_WAVEFORMS, at), (alarms.zones, ZONES, (*at, "zones"))):
        for key in keys:
            if getattr(table, key) is not None:
                raise MisfitError(words, *place, key)


MIN_BETWEEN_DEG = 30.0
MIN_SINE = math.sin(math.radians(MIN_BETWEEN_DEG)) - 1e-9
"""Smallest angle between two transducers, and its sine; below it, errors grow more than 2.7 times
in the resolution into x and y."""


class UnitSettings(Settings):
    """Settings of a generating unit."""

    id: Identifier
    """Id of the unit, unique within the plant; example: "U07"."""

    name: Annotated[str, StringConstraints(min_length=1, max_length=80)]
    """Display name of the unit; example: "Unit 7"."""

    rated_speed_rpm: Annotated[float, Field(ge=20.0, le=1500.0)]
    """Rated running speed in r/min, 20 to 1500; example: 92.3."""

    rated_power_mw: Annotated[float, Field(gt=0.0, le=2000.0)] | None = None
    """Rated active power in MW, at most 2000; example: 700.0. Operating states and film monitoring
    require this key and power_channel. Load changes are relative to the rated power."""

    rate_hz: Annotated[float, Field(ge=20.0, le=100_000.0)] = 600.0
    """Sampling rate of each channel, Hz; example: 600.0. Has no effect on polled registers, whose
    rate is 1 / poll_period_s."""

    block_samples: Annotated[int, Field(ge=1, le=10_000)] = BLOCK_SAMPLES
    """Number of samples per channel in a block. A block has one quality per channel and one set of
    slow values. Should equal the slot length of the DAQ. Example: 50, 1/12 s at 600 Hz."""

    turbine: Literal["francis", "kaplan"] = "francis"
    """Type of the turbine, "francis" or "kaplan"; the part-load vortex is evaluated for Francis
    only."""

    rotation: Literal["x_to_y", "y_to_x"] = "x_to_y"
    """Direction of rotation in the axes of the bearings: "x_to_y" or "y_to_x". An orbit in the
    opposite direction may indicate exchanged transducers."""

    speed_channel: Identifier | None = None
    """Slow channel (r/min) of the running speed; without a speed channel and a key-phase, the speed
    is that of the 1× line."""

    key_phase: Identifier | None = None
    """Waveform channel with one pulse per turn (transducer "key_phase"): source of the running
    speed, and of the angle of the shaft that slow_roll requires; example: "kp"."""

    power_channel: Identifier | None = None
    """Slow channel (MW) of the active power. Results are uncertain (power_unknown) while the
    channel has no value; without a power channel, only the speed decides whether a unit is
    steady."""

    source: SourceSettings
    """Source of the samples, of kind "modbus_ring" (a streaming DAQ), "modbus_fifo" (FIFO queues),
    "modbus_polled" (registers), "modbus_vector" (a rack with amplitudes), "can" or "simulated"."""

    slow_source: SlowDeviceSettings | None = None
    """Second device, from which slow channels are polled; none by default."""

    channel: Annotated[tuple[ChannelSettings, ...], Field(min_length=1, max_length=32)]
    """Waveform channels in the order of the device, at most 32."""

    slow_channel: Annotated[tuple[SlowChannelSettings, ...], Field(max_length=50)] = ()
    """Slow channels in the order of the device, at most 50."""

    bearing: Annotated[tuple[BearingSettings, ...], Field(min_length=1, max_length=8)]
    """Guide bearings, at most 8."""

    simulation: SimulationSettings | None = None
    """Simulated machine of a simulated DAQ or source; has no effect on real devices."""

    @property
    def sampling_hz(self) -> float:
        """Sampling rate of each channel, Hz; for polled registers, polls per second."""
        if isinstance(self.source, ModbusPolledSettings | ModbusVectorSettings):
            return self.source.rate_hz
        return self.rate_hz

    @model_validator(mode="after")
    def _check(self) -> Self:
        refuse_twice(("channel", n, "id", channel.id) for n, channel in enumerate(self.channel))
        taken = {channel.id for channel in self.channel}
        for n, slow in enumerate(self.slow_channel):
            if slow.id in taken:
                words = "is the id of a waveform channel; use another id"
                raise MisfitError(words, "slow_channel", n, "id")
        refuse_twice(("slow_channel", n, "id", slow.id) for n, slow in enumerate(self.slow_channel))
        refuse_twice(("bearing", n, "id", bearing.id) for n, bearing in enumerate(self.bearing))
        for n, bearing in enumerate(self.bearing):
            self._check_channels(n, bearing)
            self._check_slow(bearing.oil_temperature, "degC", "bearing", n, "oil_temperature")
            for key in GAP_KEYS:
                self._check_slow(getattr(bearing, key), "mm", "bearing", n, key)
        self._check_recorded()
        self._check_key_phase()
        self._check_slow(self.speed_channel, "r/min", "speed_channel")
        self._check_slow(self.power_channel, "MW", "power_channel")
        self._check_simulation()
        slow_ids = [channel.id for channel in self.slow_channel]
        channel_ids = [channel.id for channel in self.channel]
        if self.slow_source is not None:
            self.slow_source.require_fit(slow_ids)
            slow_ids = [id_ for id_ in slow_ids if id_ not in self.slow_source.mapped_channels]
        match self.source:
            case ModbusVectorSettings() | ModbusPolledSettings():
                self.source.require_fit(channel_ids, slow_ids)
            case ModbusFifoSettings():
                self.source.fifo_layout(len(channel_ids))
            case CanSettings():
                self.source.check_channels(channel_ids, slow_ids)
        self._check_alarms()
        return self

    def _check_channels(self, number: int, bearing: BearingSettings) -> None:
        known = [channel.id for channel in self.channel]
        keys = [*CHANNEL_KEYS, *(k for k in OPTIONAL_CHANNEL_KEYS if getattr(bearing, k))]
        used = [(key, getattr(bearing, key)) for key in keys]
        for key, id_ in used:
            if id_ not in known:
                raise MisfitError(_not_among(known), "bearing", number, key)
            if id_ in self._key_phases():
                raise MisfitError(
                    "must be a vibration channel, not a key_phase channel", "bearing", number, key
                )
        refuse_twice(("bearing", number, key, id_) for key, id_ in used)
        for pair in (CHANNEL_KEYS[:2], CHANNEL_KEYS[2:]):
            self._check_angles(bearing, pair)
        for key in OPTIONAL_CHANNEL_KEYS:
            if id_ := getattr(bearing, key):
                row = self._row(id_)
                if self.channel[row].angle_deg is not None:
                    words = f"does not apply to {key} of {bearing.id}, opposite a probe; remove it"
                    raise MisfitError(words, "channel", row, "angle_deg")

    def _row(self, id_: str) -> int:
        return [channel.id for channel in self.channel].index(id_)

    def _check_angles(self, bearing: BearingSettings, keys: tuple[str, ...]) -> None:
        """Check that two transducers at other angles than 0° and 90° can be resolved into x, y."""
        rows = [self._row(getattr(bearing, key)) for key in keys]
        first, second = (self.channel[row] for row in rows)
        angles_deg = angles_of(first.angle_deg, second.angle_deg)
        if angles_deg == USUAL_DEG:
            return
        place, between_deg = f"{keys[1]} of {bearing.id}", angles_deg[1] - angles_deg[0]
        at = ("channel", rows[0] if second.angle_deg is None else rows[1], "angle_deg")
        if abs(math.sin(math.radians(between_deg))) < MIN_SINE:
            raise MisfitError(
                f"makes {keys[0]} and {place} nearly parallel, {between_deg:g}° apart; at least"
                f" {MIN_BETWEEN_DEG:g}° are needed to find x and y",
                *at,
            )
        if first.transducer is not second.transducer:
            words = f"requires transducers of the same kind as {keys[0]} and {place}"
            raise MisfitError(words, *at)
        if isinstance(self.source, ModbusVectorSettings):
            words = 'does not apply to a source of kind "modbus_vector"'
            raise MisfitError(f"{words}, whose amplitudes cannot be resolved into x and y", *at)

    def _key_phases(self) -> list[str]:
        return [c.id for c in self.channel if c.transducer is Transducer.KEY_PHASE]

    def _check_key_phase(self) -> None:
        if self.key_phase is not None and self.key_phase not in self._key_phases():
            words = ", ".join(self._key_phases()) or "none"
            limit = f'must be a channel with transducer "key_phase"; known: {words}'
            raise MisfitError(limit, "key_phase")

    def _check_slow(self, id_: str | None, unit: str, *at: int | str) -> None:
        units = {channel.id: channel.unit for channel in self.slow_channel}
        if id_ is not None and id_ not in units:
            raise MisfitError(_not_among(units), *at)
        if id_ is not None and units[id_] != unit:
            raise MisfitError(f"must be a slow channel in {unit}, not {units[id_]}", *at)

    def _check_recorded(self) -> None:
        """Check that the slow channels with a quantity name bearings, and differ in position."""
        taken: list[tuple[str, str | None]] = []
        angles: set[tuple[str | None, float]] = set()
        for n, channel in enumerate(self.slow_channel):
            slow, at = channel.recorded, ("slow_channel", n)
            if slow is None:
                continue
            if slow.bearing not in (None, *(bearing.id for bearing in self.bearing)):
                raise MisfitError("is not a bearing of the unit; use the id of one", *at, "bearing")
            owners = [owner for reading, owner in taken if reading == slow.reading]
            if owners and (slow.bearing is None or {None, slow.bearing} & set(owners)):
                words = f"has the quantity and position of another channel, {slow.reading}"
                raise MisfitError(f"{words}; give each its own position", *at, "position")
            taken.append((slow.reading, slow.bearing))
            if slow.angle_deg is not None:
                angle = (slow.bearing, slow.angle_deg % 360.0)
                if angle in angles:
                    words = "is the angle of another pad of this bearing; correct one of them"
                    raise MisfitError(words, *at, "angle_deg")
                angles.add(angle)

    def _check_alarms(self) -> None:
        if self.id == PLANT:
            raise MisfitError("is reserved for alarms of the whole plant; choose another id", "id")
        for number, bearing in enumerate(self.bearing):
            at = ("bearing", number, "alarms")
            if isinstance(self.source, ModbusVectorSettings):
                _require_no_waveforms(bearing.alarms, at)
                continue
            self._check_gaps(bearing, at)
            for n, reference in enumerate(bearing.alarms.order1_reference):
                for place, vector in reference.vectors().items():
                    if len(vector) == 2 and self.key_phase is None:
                        words = "phase requires key_phase of the unit; else give only the amplitude"
                        raise MisfitError(words, *at, "order1_reference", n, place)

    def _check_gaps(self, bearing: BearingSettings, at: tuple[str | int, ...]) -> None:
        probes = {c.id for c in self.channel if c.transducer is Transducer.PROXIMITY_PROBE}
        in_x = bearing.gap_x is not None or bearing.shaft_x in probes
        in_y = bearing.gap_y is not None or bearing.shaft_y in probes
        if bearing.alarms.gap_um is not None and not (in_x or in_y):
            words = "requires a proximity probe or a slow channel gap_x or gap_y"
            raise MisfitError(words, *at, "gap_um")
        if bearing.alarms.eccentricity_ratio is not None and not (in_x and in_y):
            words = "requires gaps in x and y, from proximity probes or slow channels gap_x, gap_y"
            raise MisfitError(words, *at, "eccentricity_ratio")

    def _check_simulation(self) -> None:
        simulation = self.simulation
        if simulation is None:
            if isinstance(self.source, SimulatedSettings):
                raise MisfitError("requires a [unit.simulation] table", "source", "kind")
            return
        names = [bearing.bearing for bearing in simulation.bearing] or ["UJB", "LJB", "TJB"]
        for number, bearing in enumerate(self.bearing):
            if bearing.id not in names:
                allowed = " or ".join(names)
                raise MisfitError(f"must be {allowed} in a simulation", "bearing", number, "id")
        cutoff_hz = simulation.hydraulic_cutoff_hz
        if cutoff_hz is not None and cutoff_hz >= self.rate_hz / 2:
            limit = f"must be below half the sampling rate, {self.rate_hz / 2:g} Hz"
            raise MisfitError(limit, "simulation", "hydraulic_cutoff_hz")


def _not_among(known: Iterable[str]) -> str:
    return f"unknown channel; known channels: {', '.join(known) or 'none'}"
