"""Sample feed of a simulated generating unit, with its slow values and its true state."""

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from acquisition.errors import ConfigError
from acquisition.simulated.plant.conditions import Conditions, between
from acquisition.simulated.plant.faults import FaultInjector, to_counts
from acquisition.simulated.plant.films import Film
from acquisition.simulated.plant.plant import CHUNK_SAMPLES, SimulatedPlant
from acquisition.simulated.plant.probes import probes
from acquisition.simulated.plant.scenario import Course, Scenario
from core.machine.channel import PAD_TEMPERATURE
from core.machine.unit import Unit
from core.samples.blocks import SampleBlock, SideValues
from core.samples.calibration import UnitCalibration
from core.units import NS_PER_S, rad_s_from_rpm

SLOW_VALUES = {
    PAD_TEMPERATURE: (12.0, 3.0),  # above the oil
    "oil_inlet_temperature": (38.0, 2.0),
    "oil_outlet_temperature": (44.0, 3.0),
    "cooling_water_inlet_temperature": (22.0, 0.0),
    "cooling_water_outlet_temperature": (24.0, 3.0),
    "cold_air_temperature": (30.0, 5.0),
    "hot_air_temperature": (35.0, 25.0),
    "stator_temperature": (40.0, 45.0),
    "rotor_temperature": (42.0, 48.0),
    "head": (119.0, -1.5),
    "gate_opening": (12.0, 72.0),
    "excitation_current": (1600.0, 1900.0),
    "excitation_voltage": (140.0, 190.0),
}
"""Value of each slow quantity without load, and its change up to `RATED_POWER_MW`."""

RATED_POWER_MW = 700.0
PAD_LOAD_K = 10.0
"""Rise of the temperature of a pad at an eccentricity ratio of 1 towards it."""


def slow_values(machine: Unit, now: Conditions, speed_rpm: float) -> dict[str, float]:
    """Return the values of all slow channels of a simulated unit by channel id; gaps in mm."""
    values: dict[str | None, float] = {
        machine.speed_channel: speed_rpm,
        machine.power_channel: now.active_power_mw,
    }
    oil_c = now.oil_temperature_c + now.oil_temperature_error_c
    values |= {b.oil_temperature: float(c) for b, c in zip(machine.bearings, oil_c, strict=True)}
    for index, bearing in enumerate(machine.bearings):
        load = complex(*now.centre_um[index]) / bearing.clearance_um
        for slow in machine.slow_channels_of(bearing.id):
            at_rest, at_rated = SLOW_VALUES[slow.quantity]
            values[slow.id] = at_rest + at_rated * now.active_power_mw / RATED_POWER_MW
            if slow.quantity == PAD_TEMPERATURE:
                side = cmath.rect(1.0, -math.radians(slow.angle_deg or 0.0))
                values[slow.id] += float(oil_c[index]) + PAD_LOAD_K * (load * side).real
    for probe in probes(machine):
        from_reference_um = probe.gap_um(now) - probe.reference_um
        shown_um = probe.reference_um + float(now.gain[probe.row]) * from_reference_um
        values[probe.slow_channel] = shown_um / 1e3
    return {name: value for name, value in values.items() if name is not None}


@dataclass(frozen=True)
class BearingTruth:
    """True state of one simulated bearing at one instant.

    Parameters
    ----------
    k_eff_xx_n_per_m, k_eff_yy_n_per_m
        Effective stiffness ``|k + iΩc|`` in x and y at the running speed Ω (Brito et al.,
        equation 5).
    eccentricity
        Distance of the shaft centre from the bearing centre divided by the clearance.
    gap_growth_um
        Common growth of all gaps of the bearing.
    bracket_stiffness_n_per_m
        True stiffness of the bracket, which may differ from the configured stiffness.
    """

    film: Film
    k_eff_xx_n_per_m: float
    k_eff_yy_n_per_m: float
    centre_x_um: float
    centre_y_um: float
    eccentricity: float
    oil_temperature_c: float
    gap_growth_um: float
    bracket_stiffness_n_per_m: float


@dataclass(frozen=True)
class UnitTruth:
    """True state of a simulated unit at one instant; bearings by id."""

    speed_rpm: float
    active_power_mw: float
    bearings: Mapping[str, BearingTruth]


def _unit_truth(machine: Unit, scenario: Scenario, now: Conditions, speed_rpm: float) -> UnitTruth:
    """Return the true state of a simulated unit under given conditions and at a given speed."""
    brackets = {b.bearing: b.stiffness_n_per_m for b in scenario.true_rotor.brackets}
    bearings = {}
    for index, bearing in enumerate(machine.bearings):
        film, turn_rad_s = scenario.bearings[bearing.id].film, rad_s_from_rpm(speed_rpm)
        k_eff = film.effective_stiffness_n_per_m(turn_rad_s)
        film = film.at(turn_rad_s) if film.lags and turn_rad_s > 0.0 else film
        centre_x_um, centre_y_um = (float(c) for c in now.centre_um[index])
        bearings[bearing.id] = BearingTruth(
            film=film,
            k_eff_xx_n_per_m=k_eff[0],
            k_eff_yy_n_per_m=k_eff[1],
            centre_x_um=centre_x_um,
            centre_y_um=centre_y_um,
            eccentricity=math.hypot(centre_x_um, centre_y_um) / bearing.clearance_um,
            oil_temperature_c=float(now.oil_temperature_c[index]),
            gap_growth_um=float(now.gap_growth_um[index]),
            bracket_stiffness_n_per_m=brackets[bearing.id],
        )
    return UnitTruth(speed_rpm, now.active_power_mw, bearings)


class SimulatedUnit:
    """Sample feed of one simulated unit.

    The same seed gives the same counts, independent of the requested block lengths.

    Parameters
    ----------
    machine
        Unit with one or more of the bearings UJB, LJB and TJB.
    scenario
        A `Scenario` for steady operation, or a course of scenarios.
    start_ns
        Time of sample 0; its whole seconds are the epoch of the blocks.

    Raises
    ------
    ConfigError
        If machine, calibration and scenario do not fit together.
    """

    def __init__(
        self,
        machine: Unit,
        calibration: UnitCalibration,
        scenario: Course,
        seed: int,
        start_ns: int,
    ) -> None:
        _check(machine, calibration)
        self._machine = machine
        self._calibration = calibration
        first = scenario.at(0.0)
        self._start_ns = start_ns
        self._plant = SimulatedPlant(machine, scenario, seed)
        self._faults = _faults(machine, first, seed)
        self._exchanged = _exchanged(machine, calibration, first)
        self._index = 0
        self._next_chunk()

    def advance(self, n_samples: int) -> SampleBlock:
        """Return the next `n_samples` consecutive samples.

        Raises ValueError if `n_samples` is less than 1.
        """
        if n_samples < 1:
            raise ValueError(f"n_samples must be at least 1, got {n_samples}")
        first_index, slow = self._index, self._slow()
        parts = []
        while n_samples:
            offset = self._index % CHUNK_SAMPLES
            part = self._counts[:, offset : offset + n_samples]
            parts.append(part)
            n_samples -= part.shape[1]
            self._index += part.shape[1]
            if self._index % CHUNK_SAMPLES == 0:
                self._next_chunk()
        start_ns = self._start_ns + round(first_index * NS_PER_S / self._machine.rate_hz)
        return SampleBlock(
            calibration=self._calibration,
            epoch=self._start_ns // NS_PER_S,
            first_index=first_index,
            counts=np.concatenate(parts, axis=1),
            side=SideValues.of(start_ns, (True,) * len(self._machine.channels), slow),
        )

    def begin_at(self, start_ns: int) -> None:
        """Change the time of sample 0, which sets the times and the epoch of the next blocks."""
        self._start_ns = start_ns

    def truth(self) -> UnitTruth:
        """Return the true state at the next sample."""
        return _unit_truth(
            self._machine, self._chunk.scenario, self._conditions(), self._speed_rpm()
        )

    def _next_chunk(self) -> None:
        self._chunk = self._plant.advance()
        self._counts = to_counts(self._chunk.readings, self._calibration)
        self._faults.spoil(self._counts, self._index)
        for rows in self._exchanged:
            self._counts[rows] = self._counts[rows[::-1]]

    def _speed_rpm(self) -> float:
        offset = self._index % CHUNK_SAMPLES
        return self._plant.speed_rpm(self._chunk, offset)

    def _conditions(self) -> Conditions:
        fraction = self._index % CHUNK_SAMPLES / CHUNK_SAMPLES
        return between(self._chunk.start, self._chunk.stop, fraction)

    def _slow(self) -> tuple[float, ...]:
        values = slow_values(self._machine, self._conditions(), self._speed_rpm())
        return tuple(values.get(channel.id, math.nan) for channel in self._calibration.slow)


def _check(machine: Unit, calibration: UnitCalibration) -> None:
    if len(calibration.channels) != len(machine.channels):
        raise ConfigError(
            f"the calibration of unit {machine.id!r} must have {len(machine.channels)} channels,"
            f" got {len(calibration.channels)}"
        )
    if calibration.rate_hz != machine.rate_hz:
        raise ConfigError(
            f"the calibration of unit {machine.id!r} must be for {machine.rate_hz} Hz,"
            f" got {calibration.rate_hz} Hz"
        )


def _faults(machine: Unit, scenario: Scenario, seed: int) -> FaultInjector:
    rows = {channel.id: row for row, channel in enumerate(machine.channels)}
    return FaultInjector(
        np.random.default_rng(seed),
        {rows[id_]: channel.faults for id_, channel in scenario.channels.items()},
    )


def _exchanged(machine: Unit, calibration: UnitCalibration, scenario: Scenario) -> list[list[int]]:
    """Return the pairs of channel rows with swapped cables."""
    rows = {channel.id: row for row, channel in enumerate(machine.channels)}
    pairs = []
    for pair in scenario.exchanged:
        names = " and ".join(pair)
        if not rows.keys() >= set(pair):
            raise ConfigError(f"the exchanged channels {names} must both be in unit {machine.id!r}")
        first, second = (calibration.channels[rows[id_]].full_scale_v for id_ in pair)
        if first != second:
            raise ConfigError(
                f"channels {names} cannot be exchanged: their full scales must be"
                f" equal, but are {first} V and {second} V"
            )
        pairs.append([rows[id_] for id_ in pair])
    return pairs
