"""Which motion of the rotor each transducer sees, and as what."""

import numpy as np

from acquisition.errors import ConfigError
from acquisition.simulated.plant.probes import probes
from acquisition.simulated.plant.rotor import (
    RotorMatrices,
    RotorParameters,
    bracket_motion,
    relative_motion,
)
from acquisition.simulated.plant.rotor_steps import state_matrix
from core.arrays import FloatArray
from core.machine.channel import Measurand
from core.machine.unit import Unit

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
