"""Uncertainty of what is read off single channels: amplitudes, phases, gaps, slow values.

The random part comes from how far segments or polls differ among themselves.
"""

import math

import numpy as np

from core.arrays import ComplexArray
from core.machine.unit import Bearing
from core.spectra.cross_spectrum import BEARING_X, BEARING_Y
from core.stiffness.stiffness_budget import BEARING_GAIN, RUNOUT
from core.uncertainty import (
    SHAFT_GAIN,
    Budget,
    BudgetLine,
    mean_budget,
    systematic_line,
)


def amplitude_budget(
    amplitude_um_pk: float, phasors_um_pk: ComplexArray, systematic: tuple[BudgetLine, ...]
) -> Budget | None:
    """Uncertainty of the root mean square of the amplitudes of phasors (n,), µm 0-pk."""
    if amplitude_um_pk == 0.0:
        return None
    power = np.abs(phasors_um_pk) ** 2
    return mean_budget(amplitude_um_pk, power, systematic, 0.5 / amplitude_um_pk)


def phase_budget(
    phase_deg: float, vectors: ComplexArray, systematic: tuple[BudgetLine, ...] = ()
) -> Budget | None:
    """Uncertainty of the phase, deg, of the mean of vectors (n,); beyond 0 or 360° it goes on."""
    mean = complex(vectors.mean())
    across = (vectors * np.conj(mean)).imag / abs(mean) ** 2
    return mean_budget(phase_deg, across, systematic, math.degrees(1.0))


def amplitude_lines(
    bearing: Bearing, place: int, value: float, runout_um_pk: float = 0.0
) -> tuple[BudgetLine, ...]:
    """What stays the same in an amplitude, µm 0-pk, or another measure of a channel's motion.

    Parameters
    ----------
    place
        Of the channel among the bearing's four.
    runout_um_pk
        Of the shaft's surface, as far as the value holds it.
    """
    if place in (BEARING_X, BEARING_Y):
        return (systematic_line(BEARING_GAIN, bearing.accuracy.bearing_gain, value),)
    return (
        systematic_line(SHAFT_GAIN, bearing.accuracy.shaft_gain, value),
        systematic_line(RUNOUT, runout_um_pk, 1.0),
    )


def phase_lines(runout_um_pk: float, amplitude_um_pk: float) -> tuple[BudgetLine, ...]:
    """What stays the same in a phase, deg: runout turns a vector by so much at most."""
    turned = math.asin(min(1.0, runout_um_pk / amplitude_um_pk))
    return (systematic_line(RUNOUT, math.degrees(turned), 1.0),)
