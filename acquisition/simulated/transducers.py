"""What probes and accelerometers make of the motion of the rotor: output map, gap, noise."""

import numpy as np

from acquisition.errors import ConfigError
from acquisition.simulated.conditions import Conditions
from acquisition.simulated.scenario import TransducerNoise
from core.arrays import FloatArray
from core.machine import Measurand, Unit
from core.rotor import RotorMatrices, bracket_motion, relative_motion
from core.rotor_discrete import state_matrix
from core.rotor_parameters import RotorParameters

SHAFT, BEARING = "shaft", "bearing"


def output_map(machine: Unit, parameters: RotorParameters, matrices: RotorMatrices) -> FloatArray:
    """Map the state of the rotor to what the transducers see, without gap and noise.

    Returns
    -------
    (n_channels, n_states) in each channel's engineering unit. The transducers' own frequency
    response is flat.

    Raises
    ------
    ConfigError
        If a bearing is none of the rotor's, if a channel belongs to no bearing, or if it measures
        what its place does not have.
    """
    maps, places = _motion_maps(parameters, matrices), _places(machine, parameters)
    rows = []
    for channel in machine.channels:
        if channel.id not in places:
            raise ConfigError(f"channel {channel.id!r} belongs to no bearing of {machine.id!r}")
        part, row = places[channel.id]
        if (part, channel.measurand) not in maps:
            raise ConfigError(
                f"channel {channel.id!r} of a {part} cannot measure {channel.measurand.value}"
            )
        rows.append(channel.direction * maps[part, channel.measurand][row])
    return np.stack(rows)


def standing_gap_um(machine: Unit, now: Conditions) -> FloatArray:
    """Mean reading of every channel, (n_channels,): the gap of the probes, zero elsewhere."""
    centred_um, centre_um = {}, {}
    for index, bearing in enumerate(machine.bearings):
        for axis, probe in enumerate((bearing.shaft_x, bearing.shaft_y)):
            centred_um[probe] = bearing.gap_reference_um[axis]
            centre_um[probe] = now.centre_um[index, axis]
    return np.array(
        [
            centred_um[c.id] + c.direction * centre_um[c.id]
            if c.measurand is Measurand.GAP_UM
            else 0.0
            for c in machine.channels
        ]
    )


def noise_rms(machine: Unit, noise: TransducerNoise) -> FloatArray:
    """White noise of each channel in its engineering unit, (n_channels,)."""
    by_measurand = {
        Measurand.GAP_UM: noise.gap_um_rms,
        Measurand.DISPLACEMENT_UM: noise.displacement_um_rms,
        Measurand.VELOCITY_MM_S: noise.velocity_mm_s_rms,
        Measurand.ACCELERATION_M_S2: noise.acceleration_m_s2_rms,
    }
    return np.array([by_measurand[channel.measurand] for channel in machine.channels])


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
        places[bearing.shaft_x] = (SHAFT, row)
        places[bearing.shaft_y] = (SHAFT, row + 1)
        places[bearing.bearing_x] = (BEARING, row)
        places[bearing.bearing_y] = (BEARING, row + 1)
    return places
