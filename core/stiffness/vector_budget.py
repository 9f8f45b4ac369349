"""Uncertainty of equation (5) when a rack gives amplitudes and no waveforms."""

import math

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.machine.unit import BearingAccuracy, BracketDynamics
from core.stiffness.stiffness_budget import BEARING_GAIN, BRACKET, CROSS_COUPLING, RUNOUT
from core.uncertainty import SHAFT_GAIN, Budget, effective_number, random_line, systematic_line

SPREAD = "spread of polls"
COHERENCE = "coherence not known"


def vector_ratio_budget(
    shaft_um_pk: FloatArray,
    bearing_um_pk: FloatArray,
    frequency_hz: float,
    bracket: BracketDynamics,
    accuracy: BearingAccuracy,
    coherence: float,
    runout_um_pk: float = 0.0,
    across: float = 1.0,
) -> Budget | None:
    """Uncertainty of ``|X_b| / |U| k_b`` over some polls.

    A rack may be asked more often than it measures, or average for longer than a poll period: the
    spread of the polls is divided by their effective number.

    Parameters
    ----------
    shaft_um_pk, bearing_um_pk : (n_polls,)
        Amplitudes of the same polls; shaft amplitudes above zero.
    coherence
        Squared, of the two; without phases the least that would be accepted of waveforms.
    runout_um_pk
        Largest runout at this line, not taken off.
    across
        Shaft amplitude across this direction over that along it.

    Returns
    -------
    None with fewer than two independent polls.
    """
    independent = n_effective(shaft_um_pk, bearing_um_pk)
    if independent < 2.0:
        return None
    shaft = float(np.sqrt(np.mean(shaft_um_pk**2)))
    value = float(np.sqrt(np.mean(bearing_um_pk**2))) / shaft * bracket.stiffness_n_per_m
    each = bearing_um_pk / shaft_um_pk * bracket.stiffness_n_per_m
    random = float(np.std(each, ddof=1)) / math.sqrt(independent)
    omega = 2.0 * math.pi * frequency_hz
    inertia = bracket.max_mass_kg * omega**2 / bracket.stiffness_n_per_m
    return Budget(
        value,
        (
            random_line(SPREAD, random, independent - 1.0),
            systematic_line(SHAFT_GAIN, accuracy.shaft_gain, -value),
            systematic_line(BEARING_GAIN, accuracy.bearing_gain, value),
            systematic_line(BRACKET, accuracy.bracket_stiffness, value),
            systematic_line(COHERENCE, 1.0 / math.sqrt(coherence) - 1.0, value),
            systematic_line("bracket inertia left out", inertia, value),
            systematic_line(RUNOUT, runout_um_pk, value / shaft),
            systematic_line(CROSS_COUPLING, accuracy.cross_coupling, value * across),
        ),
    )


def n_independent(shaft_um_pk: FloatArray, bearing_um_pk: FloatArray) -> int:
    """Polls in which at least one of two amplitudes differs from the poll before."""
    return int(np.count_nonzero(_changed(shaft_um_pk, bearing_um_pk)))


def n_effective(shaft_um_pk: FloatArray, bearing_um_pk: FloatArray) -> float:
    """How many independent polls would say as much as these, at least 2 of 2 or more.

    A rack averages, perhaps for longer than a poll period: neighbouring polls then share much of
    what they show.
    """
    changed = _changed(shaft_um_pk, bearing_um_pk)
    return effective_number(bearing_um_pk[changed] / shaft_um_pk[changed])


def _changed(shaft_um_pk: FloatArray, bearing_um_pk: FloatArray) -> npt.NDArray[np.bool_]:
    changed = np.ones(shaft_um_pk.size, dtype=np.bool_)
    changed[1:] = (np.diff(shaft_um_pk) != 0.0) | (np.diff(bearing_um_pk) != 0.0)
    return changed
