"""Shape over frequency of the part of a film that lags as its pads tilt, and what is known of it.

A pad without inertia tilts with the whirl of the shaft with one lag (decision 37).
"""

import numpy as np

from core.arrays import ComplexArray, FloatArray

TILT_LAG_RAD, TILT_LAG_STD = 0.135, 0.2
"""Prior mean and relative standard deviation of the angle by which the shaft turns during the lag.
It is about half the time that oil takes along a pad: 0.10 to 0.17 rad for the 12 and 16 pads of
Brito et al."""

LAG_PRIOR = 0.3
"""Prior standard deviation of a lagging part as a fraction of the row's direct dynamic stiffness.
Pads of Brito et al. have -0.19 to 0.46 of their stiffness, up to eccentricity ratios of 0.6."""

MAX_DEVIATION = 2.5
"""Largest deviation of the lag from its prior mean, in standard deviations of the prior."""


def tilt_lag(
    omega: FloatArray, turn_rad_s: float, deviation: FloatArray
) -> tuple[ComplexArray, ComplexArray]:
    """Return the dynamic stiffness of a unit lagging part, and its derivative, (n, k, n_lines).

    It is ``(iωτ)² / (1 + iωτ)`` less the stiffness and damping at 1×, where it is zero.

    Parameters
    ----------
    omega : (n, 1, n_lines)
        Angular frequencies.
    deviation : (n, k)
        Deviations of the lag τ from its prior mean, in standard deviations of the prior.
    """
    deviation = np.clip(deviation, -MAX_DEVIATION, MAX_DEVIATION)[..., np.newaxis]
    lag_s = TILT_LAG_RAD / turn_rad_s * (1.0 + TILT_LAG_STD * deviation)

    def lagging(omega: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        turned = 1j * omega * lag_s
        per_lag = turned**2 * (2.0 + turned) / (1.0 + turned) ** 2 / lag_s
        per_deviation = per_lag * TILT_LAG_STD * TILT_LAG_RAD / turn_rad_s
        return turned**2 / (1.0 + turned), per_deviation

    def beside_turn(of_lines: ComplexArray, at_turn: ComplexArray) -> ComplexArray:
        return of_lines - at_turn.real - 1j * at_turn.imag * omega / turn_rad_s

    at_lines, at_turn = lagging(omega), lagging(np.full((1, 1, 1), turn_rad_s))
    return beside_turn(at_lines[0], at_turn[0]), beside_turn(at_lines[1], at_turn[1])
