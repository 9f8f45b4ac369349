"""Uncertainty budgets of amplitudes, phases, coherences, roundness and frequencies.

The random part is the scatter of the segments or polls.
"""

import math

import numpy as np

from core.arrays import ComplexArray, FloatArray
from core.machine.unit import Bearing
from core.spectra.cross_spectrum import BEARING_X, BEARING_Y
from core.spectra.speed import Speed
from core.stiffness.stiffness_budget import BEARING_GAIN, RUNOUT, STATISTICS
from core.uncertainty import (
    SHAFT_GAIN,
    Budget,
    BudgetLine,
    Kind,
    coverage_factor,
    mean_budget,
    proportional,
    random_line,
    systematic_line,
)


def amplitude_budget(
    amplitude_um_pk: float, phasors_um_pk: ComplexArray, systematic: tuple[BudgetLine, ...]
) -> Budget | None:
    """Return the uncertainty budget of the rms amplitude of phasors (n,), µm 0-pk.

    The `systematic` contributions are added. None if the amplitude is zero, or the phasors have no
    scatter.
    """
    if amplitude_um_pk == 0.0:
        return None
    power = np.abs(phasors_um_pk) ** 2
    return mean_budget(amplitude_um_pk, power, systematic, 0.5 / amplitude_um_pk)


def phase_budget(
    phase_deg: float, vectors: ComplexArray, runout_um_pk: float = 0.0
) -> Budget | None:
    """Return the uncertainty budget of the phase of a mean vector, deg, not wrapped at 0 or 360°.

    `vectors` are the averaged vectors (n,), whose mean is not 0. The contribution of runout is its
    largest possible rotation of the mean vector. Return None if the vectors have no scatter.
    """
    mean = complex(vectors.mean())
    across = (vectors * np.conj(mean)).imag / abs(mean) ** 2
    turned = math.asin(min(1.0, runout_um_pk / abs(mean)))
    lines = (systematic_line(RUNOUT, math.degrees(turned), 1.0),)
    return mean_budget(phase_deg, across, lines, math.degrees(1.0))


def amplitude_lines(
    bearing: Bearing, place: int, value: float, runout_um_pk: float = 0.0
) -> tuple[BudgetLine, ...]:
    """Return the systematic contributions to an amplitude or another measure of vibration.

    `place` is the index of the channel among the four of the bearing; `runout_um_pk` is the largest
    shaft runout contained in `value`.
    """
    if place in (BEARING_X, BEARING_Y):
        return (systematic_line(BEARING_GAIN, bearing.accuracy.bearing_gain, value),)
    return (
        systematic_line(SHAFT_GAIN, bearing.accuracy.shaft_gain, value),
        systematic_line(RUNOUT, runout_um_pk, 1.0),
    )


def coherence_budget(coherence: float, n_segments: float) -> Budget | None:
    """Return the uncertainty budget of a squared coherence.

    The variance is that of Bendat and Piersol (Random Data, 2010), table 9.6. The estimate is
    skewed, especially near 0 and 1 and with few segments. ``artanh γ`` is nearly normal with
    variance and bias ``1 / (2 (n - 1))`` (Enochson and Goodman 1965); its interval is transformed
    to γ². `n_segments` is the number of independent segments.

    Returns
    -------
    The budget; None if the coherence is exactly 0 or 1, or with fewer than two segments.
    """
    if not (0.0 < coherence < 1.0 and n_segments >= 2.0):
        return None
    root, variance = math.sqrt(coherence), 0.5 / (n_segments - 1.0)
    std = 2.0 * root * (1.0 - coherence) * math.sqrt(variance)
    centre, reach = math.atanh(root) - variance, coverage_factor(()) * math.sqrt(variance)
    interval = (math.tanh(max(centre - reach, 0.0)) ** 2, math.tanh(centre + reach) ** 2)
    return Budget(coherence, (random_line(STATISTICS, std),), interval)


def roundness_budget(
    bearing: Bearing, roundness: float, phasors_um_pk: ComplexArray, runout_um_pk: tuple[float, ...]
) -> Budget | None:
    """Return the uncertainty budget of the roundness of an orbit (`cross_spectrum.roundness`).

    The random part is a first-order jackknife: the influence of each segment on the roundness. The
    interval is limited to -1 to 1. Return None if the shaft does not move or has no scatter.
    `phasors_um_pk` (n, 2) are those of u_x and u_y in the segments or polls in which both are
    usable; `runout_um_pk` is the largest runout contained in each.
    """
    x, y = phasors_um_pk.T
    of_each = np.abs(x) ** 2 + np.abs(y) ** 2
    power = float(of_each.mean()) if of_each.size else 0.0
    if not power > 0.0:
        return None
    moves = (2.0 * (x * y.conj()).imag - roundness * of_each) / power
    x_share = float(np.mean(np.abs(x) ** 2)) / power
    gain, left = bearing.accuracy.shaft_gain, max(1.0 - roundness**2, 0.0)
    across = np.sqrt(np.array([1.0 - x_share, x_share]) * left / power)
    lines = (
        systematic_line(SHAFT_GAIN, gain, roundness * (1.0 - 2.0 * x_share)),
        systematic_line(SHAFT_GAIN, gain, roundness * (2.0 * x_share - 1.0)),
        *(
            systematic_line(RUNOUT, r, 2.0 * float(a))
            for r, a in zip(runout_um_pk, across, strict=True)
        ),
    )
    found = mean_budget(roundness, moves, lines)
    if found is None:
        return None
    low, high = found.interval
    return Budget(roundness, found.lines, (max(low, -1.0), min(high, 1.0)))


def frequency_budget(
    frequency_hz: float, each_hz: FloatArray, speed: Speed | None
) -> Budget | None:
    """Return the uncertainty budget of the mean frequency of a line; None if unknown.

    `each_hz` (n,) are the frequencies in the segments or polls, `frequency_hz` is their mean.
    `speed` is the newest speed if they are derived from it; None if the line itself was measured.
    """
    own = None
    if speed is not None and speed.budget is not None:
        own = proportional(frequency_hz, speed.budget)
    stays = () if own is None else tuple(li for li in own.lines if li.kind is Kind.SYSTEMATIC)
    return mean_budget(frequency_hz, each_hz, stays) or own
