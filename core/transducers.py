"""What a channel's spectrum says about displacement."""

import numpy as np

from core.arrays import ComplexArray, FloatArray
from core.machine import Channel, Measurand


def displacement_factor(channel: Channel, frequency_hz: FloatArray) -> ComplexArray:
    """Displacement phasor in µm per phasor of the channel's own engineering unit.

    Velocity is integrated once, acceleration twice, by division by iω and (iω)²; what the
    transducer's own response did to the signal is undone. A key-phase shows no displacement: zero.

    Parameters
    ----------
    frequency_hz : (n_lines,)
        All above zero: a constant velocity has no displacement phasor.

    Returns
    -------
    (n_lines,)

    Raises
    ------
    ValueError
        If a frequency is zero or negative.
    """
    if np.any(frequency_hz <= 0.0):
        raise ValueError(f"frequencies must be positive, got {frequency_hz.min()} Hz")
    i_omega = 2j * np.pi * frequency_hz
    match channel.measurand:
        case Measurand.GAP_UM | Measurand.DISPLACEMENT_UM:
            factor = np.ones_like(i_omega)
        case Measurand.VELOCITY_MM_S:
            factor = 1e3 / i_omega
        case Measurand.ACCELERATION_M_S2:
            factor = 1e6 / i_omega**2
        case Measurand.KEY_PHASE_V:
            return np.zeros_like(i_omega)
    if channel.response is not None:
        factor = factor / channel.response.at(frequency_hz)
    return channel.direction * factor
