"""Signals at the transducers: mean gap and runout of the probes, vibration of all channels."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from acquisition.errors import ConfigError
from acquisition.simulated.plant.conditions import Conditions
from acquisition.simulated.plant.rotor import (
    RotorMatrices,
    RotorParameters,
    bracket_motion,
    relative_motion,
)
from acquisition.simulated.plant.rotor_steps import state_matrix
from acquisition.simulated.plant.scenario import Scenario
from core.arrays import ComplexArray, FloatArray
from core.machine.channel import Channel, Measurand
from core.machine.unit import Unit


def along(channel: Channel, axis: int) -> FloatArray:
    """Return the weights (2,) of x and y in the reading of a channel.

    A channel without an angle measures along `axis`, 0 for x or 1 for y.
    """
    if channel.angle_deg is None:
        return np.array([1.0 - axis, axis])
    theta = np.deg2rad(channel.angle_deg)
    return np.array([np.cos(theta), np.sin(theta)])


@dataclass(frozen=True)
class Probe:
    """Proximity probe at the shaft, which measures gap or displacement.

    Parameters
    ----------
    row, bearing
        Indices of the probe's channel and of its bearing in the unit.
    slow_channel
        Id of the slow channel of the mean gap; None if the unit has no such channel.
    axis
        Axis of the probe: 0 is x, 1 is y.
    opposite
        Whether the probe is on the negative axis, opposite the main probe.
    reference_um
        Gap at a centred shaft.
    """

    row: int
    channel: Channel
    slow_channel: str | None
    bearing: int
    axis: int
    opposite: bool
    reference_um: float

    @property
    def measures_gap(self) -> bool:
        """Whether the reading includes the mean gap."""
        return self.channel.measurand is Measurand.GAP_UM

    def gap_um(self, now: Conditions) -> float:
        """Return the mean gap in µm under given conditions, including the position error."""
        centre_um = now.centre_um[self.bearing] + now.position_error_um[self.bearing]
        shift_um = float(along(self.channel, self.axis) @ centre_um)
        growth_um = float(now.gap_growth_um[self.bearing])
        return self.reference_um + self.channel.direction * shift_um + growth_um


def probes(machine: Unit) -> Iterator[Probe]:
    """Yield all proximity probes of a unit."""
    rows = {channel.id: row for row, channel in enumerate(machine.channels)}
    for index, bearing in enumerate(machine.bearings):
        near_um, far_um = bearing.gap_reference_um, bearing.opposite_reference_um
        for channel, slow, axis, opposite in (
            (bearing.shaft_x, bearing.gap_x, 0, False),
            (bearing.shaft_y, bearing.gap_y, 1, False),
            (bearing.opposite_x, bearing.opposite_gap_x, 0, True),
            (bearing.opposite_y, bearing.opposite_gap_y, 1, True),
        ):
            if channel is not None:
                reference_um = (far_um or near_um) if opposite else near_um
                row = rows[channel]
                yield Probe(
                    row, machine.channels[row], slow, index, axis, opposite, reference_um[axis]
                )


def standing_gap_um(machine: Unit, now: Conditions | None = None) -> FloatArray:
    """Return the mean reading of each channel, (n_channels,): mean gap of gap probes, others zero.

    If `now` is None, the shaft is centred.
    """
    reading_um = np.zeros(len(machine.channels))
    for probe in probes(machine):
        if probe.measures_gap:
            reading_um[probe.row] = probe.reference_um if now is None else probe.gap_um(now)
    return reading_um


class ShaftRunout:
    """Runout of the shaft surface in the signals of the probes."""

    def __init__(self, machine: Unit, scenario: Scenario) -> None:
        self._phasors: dict[int, ComplexArray] = {}
        for probe in probes(machine):
            channel = probe.channel
            runout = scenario.bearings[machine.bearings[probe.bearing].id].runout_um_pk
            own = scenario.channel(channel.id).runout_um_pk
            phasors = np.zeros(max(len(runout), len(own)), np.complex128)
            order = np.arange(1, len(runout) + 1)
            passed = np.exp(-0.5j * np.pi * order * (probe.axis + 2 * probe.opposite))
            # a bump is a smaller gap, or a displacement towards the probe
            sign = -1 if probe.measures_gap else channel.direction * (-1 if probe.opposite else 1)
            phasors[: len(runout)] += sign * np.array(runout) * passed
            phasors[: len(own)] += channel.direction * np.array(own)
            if phasors.any():
                self._phasors[probe.row] = phasors

    def add_to(self, readings: FloatArray, turns: FloatArray) -> None:
        """Add the runout to the readings of the probe channels, in place.

        `readings` is (n_channels, n_samples); `turns` (n_samples,) is the shaft angle in turns.
        """
        if not self._phasors:
            return
        once = np.exp(2j * np.pi * np.fmod(turns, 1.0))
        for row, phasors in self._phasors.items():
            # Horner: phasors times powers of one turn
            total = np.zeros_like(once)
            for phasor in phasors[::-1]:
                total = (total + phasor) * once
            readings[row] += total.real


SHAFT, BEARING = "shaft", "bearing"


def output_map(machine: Unit, parameters: RotorParameters, matrices: RotorMatrices) -> FloatArray:
    """Return the matrix that maps the state of the rotor to the vibration at the transducers.

    Returns
    -------
    (n_channels, n_states) in the engineering unit of each channel, without the frequency response
    of the transducers.

    Raises
    ------
    ConfigError
        If a bearing is missing from the rotor, a channel belongs to no bearing, or a channel has
        a measurand that does not exist at its part, shaft or bearing.
    """
    maps, places = _motion_maps(parameters, matrices), _places(machine, parameters)
    rows = []
    for channel in machine.channels:
        if channel.measurand is Measurand.KEY_PHASE_V:
            rows.append(np.zeros(maps[SHAFT, Measurand.GAP_UM].shape[1]))  # no vibration
            continue
        if channel.id not in places:
            raise ConfigError(
                f"channel {channel.id!r} belongs to no bearing of unit {machine.id!r}"
            )
        part, row = places[channel.id]
        if (part, channel.measurand) not in maps:
            raise ConfigError(
                f"channel {channel.id!r} of the {part} cannot measure {channel.measurand.value}"
            )
        row -= (axis := row % 2)
        weights = along(channel, axis)
        rows.append(channel.direction * weights @ maps[part, channel.measurand][row : row + 2])
    return np.stack(rows)


def _motion_maps(
    parameters: RotorParameters, matrices: RotorMatrices
) -> dict[tuple[str, Measurand], FloatArray]:
    """Return the matrices from the state to the signals of Brito et al., Table 3, (6, n_states)."""
    shaft, bracket = relative_motion(parameters), bracket_motion(parameters)
    still, lags = np.zeros_like(shaft), np.zeros((len(shaft), matrices.lag_s.size))
    shaft_um = 1e6 * np.hstack([shaft, still, lags])
    return {
        (SHAFT, Measurand.GAP_UM): shaft_um,
        (SHAFT, Measurand.DISPLACEMENT_UM): shaft_um,
        (BEARING, Measurand.DISPLACEMENT_UM): 1e6 * np.hstack([bracket, still, lags]),
        (BEARING, Measurand.VELOCITY_MM_S): 1e3 * np.hstack([still, bracket, lags]),
        # No force acts on a bracket directly, so its acceleration follows from the state alone.
        (BEARING, Measurand.ACCELERATION_M_S2): bracket
        @ state_matrix(matrices)[parameters.n_coordinates : 2 * parameters.n_coordinates],
    }


def _places(machine: Unit, parameters: RotorParameters) -> dict[str, tuple[str, int]]:
    """Return part (shaft or bearing) and row in its motion map of each channel, by channel id."""
    names = [bracket.bearing for bracket in parameters.brackets]
    places = {}
    for bearing in machine.bearings:
        if bearing.id not in names:
            raise ConfigError(
                f"unknown bearing {bearing.id!r}; the simulated rotor has {', '.join(names)}"
            )
        row = 2 * names.index(bearing.id)
        places[bearing.bearing_x] = (BEARING, row)
        places[bearing.bearing_y] = (BEARING, row + 1)
    for probe in probes(machine):
        row = 2 * names.index(machine.bearings[probe.bearing].id)
        places[probe.channel.id] = (SHAFT, row + probe.axis)
    return places
