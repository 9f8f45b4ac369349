"""What a channel's spectrum says about displacement."""

import numpy as np

from core.arrays import ComplexArray, FloatArray
from core.machine.unit import Channel, Measurand


def displacement_factor(channel: Channel, frequency_hz: FloatArray) -> ComplexArray:
    """Displacement phasor in µm per phasor of the channel's own engineering unit.

    Velocity is integrated once, acceleration twice, by division by iω and (iω)²; what the
    transducer's own response and the channel's delay did to the signal is undone. A key-phase shows
    no displacement: zero.

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
    if channel.measurand is Measurand.KEY_PHASE_V:
        return np.zeros(np.shape(frequency_hz), dtype=np.complex128)
    n = channel.measurand.n_integrations
    factor = 10.0 ** (3 * n) / (2j * np.pi * frequency_hz) ** n
    if channel.delay_s:
        factor = factor * np.exp(2j * np.pi * frequency_hz * channel.delay_s)
    if channel.response is not None:
        factor = factor / channel.response.at(frequency_hz)
    return np.asarray(channel.direction * factor, dtype=np.complex128)


def line_floor_um_pk(channel: Channel, frequency_hz: float) -> float:
    """Displacement that a line of the transducer's own noise looks like, µm 0-to-peak.

    It grows with falling frequency for what is integrated, and where the response falls off.
    """
    factor = displacement_factor(channel, np.array([frequency_hz]))[0]
    return float(abs(factor)) * channel.line_floor
