"""Proximity probes around a shaft: standing gap and runout."""

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
from acquisition.simulated.plant.scenario import ChannelScenario, Scenario
from core.arrays import ComplexArray, FloatArray
from core.machine.unit import Bearing, Measurand, Unit


@dataclass(frozen=True)
class Probe:
    """One shaft channel: its bearing, its axis (0 is x, 1 is y), its gap with a centred shaft.

    Parameters
    ----------
    opposite
        Whether it stands across the shaft, on the negative axis.
    """

    channel: str
    slow_channel: str | None
    bearing: int
    axis: int
    opposite: bool
    reference_um: float


def probes(machine: Unit) -> Iterator[Probe]:
    """All shaft channels of a unit."""
    for index, bearing in enumerate(machine.bearings):
        yield from _probes(index, bearing)


def _probes(index: int, bearing: Bearing) -> Iterator[Probe]:
    near_um, far_um = bearing.gap_reference_um, bearing.opposite_reference_um
    yield Probe(bearing.shaft_x, bearing.gap_x, index, 0, False, near_um[0])
    yield Probe(bearing.shaft_y, bearing.gap_y, index, 1, False, near_um[1])
    opposite = (
        (bearing.opposite_x, bearing.opposite_gap_x),
        (
            bearing.opposite_y,
            bearing.opposite_gap_y,
        ),
    )
    for axis, (channel, slow_channel) in enumerate(opposite):
        if channel is not None:
            reference_um = (far_um or near_um)[axis]
            yield Probe(channel, slow_channel, index, axis, True, reference_um)


def gap_um(probe: Probe, direction: int, now: Conditions) -> float:
    """Mean gap under a probe whose reading grows with motion in the given direction."""
    place = probe.bearing, probe.axis
    told_um = direction * float(now.centre_um[place] + now.position_error_um[place])
    return probe.reference_um + told_um + float(now.gap_growth_um[probe.bearing])


def reference_gap_um(machine: Unit) -> FloatArray:
    """Reading of every channel with the shaft centred, (n_channels,); else zero."""
    reference_um = {probe.channel: probe.reference_um for probe in probes(machine)}
    return np.array(
        [reference_um[c.id] if c.measurand is Measurand.GAP_UM else 0.0 for c in machine.channels]
    )


def standing_gap_um(machine: Unit, now: Conditions) -> FloatArray:
    """Mean reading of every channel, (n_channels,): the gap of the probes, zero elsewhere."""
    found = {probe.channel: probe for probe in probes(machine)}
    return np.array(
        [
            gap_um(found[c.id], c.direction, now) if c.measurand is Measurand.GAP_UM else 0.0
            for c in machine.channels
        ]
    )


class ShaftRunout:
    """A surface that is not round, turning under the probes of each bearing."""

    def __init__(self, machine: Unit, scenario: Scenario) -> None:
        rows = {channel.id: row for row, channel in enumerate(machine.channels)}
        self._phasors: dict[int, ComplexArray] = {}
        for probe in probes(machine):
            row = rows[probe.channel]
            channel = machine.channels[row]
            runout = scenario.bearings[machine.bearings[probe.bearing].id].runout_um_pk
            own = scenario.channels.get(channel.id, ChannelScenario()).runout_um_pk
            phasors = np.zeros(max(len(runout), len(own)), np.complex128)
            order = np.arange(1, len(runout) + 1)
            passed = np.exp(-0.5j * np.pi * order * (probe.axis + 2 * probe.opposite))
            # a bump towards the probe is a smaller gap, or motion along a near probe's axis
            gap = channel.measurand is Measurand.GAP_UM
            sign = -1 if gap else channel.direction * (-1 if probe.opposite else 1)
            phasors[: len(runout)] += sign * np.array(runout) * passed
            phasors[: len(own)] += channel.direction * np.array(own)
            if phasors.any():
                self._phasors[row] = phasors

    def add_to(self, readings: FloatArray, turns: FloatArray) -> None:
        """Add what the probes see of it, in place; the rest of the channels see nothing."""
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
    """Map the state of the rotor to what the transducers see of its vibration.

    Returns
    -------
    (n_channels, n_states) in each channel's engineering unit; the transducers' own frequency
    response comes later.

    Raises
    ------
    ConfigError
        If a bearing is none of the rotor's, if a channel belongs to no bearing, or if it measures
        what its place does not have.
    """
    maps, places = _motion_maps(parameters, matrices), _places(machine, parameters)
    rows = []
    for channel in machine.channels:
        if channel.measurand is Measurand.KEY_PHASE_V:
            rows.append(np.zeros(maps[SHAFT, Measurand.GAP_UM].shape[1]))  # sees the angle alone
            continue
        if channel.id not in places:
            raise ConfigError(f"channel {channel.id!r} belongs to no bearing of {machine.id!r}")
        part, row = places[channel.id]
        if (part, channel.measurand) not in maps:
            raise ConfigError(
                f"channel {channel.id!r} of a {part} cannot measure {channel.measurand.value}"
            )
        rows.append(channel.direction * maps[part, channel.measurand][row])
    return np.stack(rows)


def _motion_maps(
    parameters: RotorParameters, matrices: RotorMatrices
) -> dict[tuple[str, Measurand], FloatArray]:
    """Signals of Table 3 from the state, (6, 20) each, in the measurand's unit."""
    shaft, bracket = relative_motion(parameters), bracket_motion(parameters)
    still = np.zeros_like(shaft)
    shaft_um = 1e6 * np.hstack([shaft, still])
    return {
        (SHAFT, Measurand.GAP_UM): shaft_um,
        (SHAFT, Measurand.DISPLACEMENT_UM): shaft_um,
        (BEARING, Measurand.DISPLACEMENT_UM): 1e6 * np.hstack([bracket, still]),
        (BEARING, Measurand.VELOCITY_MM_S): 1e3 * np.hstack([still, bracket]),
        # No force acts on a bracket directly, so its acceleration follows from the state alone.
        (BEARING, Measurand.ACCELERATION_M_S2): bracket
        @ state_matrix(matrices)[parameters.n_coordinates :],
    }


def _places(machine: Unit, parameters: RotorParameters) -> dict[str, tuple[str, int]]:
    """Part and row of each channel in the maps: two rows per bracket, in the rotor's order."""
    names = [bracket.bearing for bracket in parameters.brackets]
    places = {}
    for bearing in machine.bearings:
        if bearing.id not in names:
            raise ConfigError(f"a simulated unit has bearings {', '.join(names)}: {bearing.id!r}")
        row = 2 * names.index(bearing.id)
        places[bearing.bearing_x] = (BEARING, row)
        places[bearing.bearing_y] = (BEARING, row + 1)
    for probe in probes(machine):
        row = 2 * names.index(machine.bearings[probe.bearing].id)
        places[probe.channel] = (SHAFT, row + probe.axis)
    return places
