"""Uncertainty of what is read off single channels: amplitudes, phases, gaps, slow values.

The random part comes from how far segments or polls differ among themselves.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from core.arrays import ComplexArray, FloatArray
from core.cross_spectrum import BEARING_X, BEARING_Y
from core.machine import Bearing
from core.quality import Reading
from core.stiffness_budget import BEARING_GAIN, RUNOUT, SHAFT_GAIN
from core.uncertainty import Budget, BudgetLine, random_line, systematic_line

SCATTER = "scatter"

MIN_EFFECTIVE = 2.0


def effective_number(values: FloatArray) -> float:
    """How many independent values would say as much as these (n,), at least 2 of 2 or more.

    Segments overlap, and what they show wanders: neighbours share much. For a first-order process
    ``n (1 - r) / (1 + r)`` are left, r the correlation of neighbours (Bayley and Hammersley 1946);
    negative ones are taken for chance.
    """
    if values.size <= MIN_EFFECTIVE:
        return float(values.size)
    rest = values - values.mean()
    power = float(rest @ rest)
    r = max(float(rest[1:] @ rest[:-1]) / power, 0.0) if power > 0.0 else 0.0
    return max(MIN_EFFECTIVE, values.size * (1.0 - r) / (1.0 + r))


def mean_budget(
    value: float,
    values: Sequence[float] | FloatArray,
    systematic: tuple[BudgetLine, ...] = (),
    sensitivity: float = 1.0,
) -> Budget | None:
    """Uncertainty of a mean, or of what is calculated from one.

    Parameters
    ----------
    value
        The result.
    values : (n,)
        What the mean is of, oldest first.
    systematic
        What stays from one averaging time to the next.
    sensitivity
        Change of the result per change of the mean.

    Returns
    -------
    None where fewer than two values are known, or where they never differ: a transmitter that
    repeats itself says nothing of how well it measures.
    """
    known = np.asarray(values, dtype=np.float64)
    if known.size < MIN_EFFECTIVE or not np.ptp(known) > 0.0:
        return None
    n_effective = effective_number(known)
    standard = abs(sensitivity) * float(np.std(known, ddof=1)) / math.sqrt(n_effective)
    return Budget(value, (random_line(SCATTER, standard, n_effective - 1.0), *systematic))


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


def numbers(readings: Sequence[Reading]) -> FloatArray:
    """Of those that have one."""
    return np.array([r.value for r in readings if r.value is not None], np.float64)


def with_budgets(
    readings: Mapping[str, Reading], found: Mapping[str, Budget | None]
) -> tuple[dict[str, Reading], dict[str, Budget]]:
    """Readings that have a number with their uncertainty, and the budgets that say so."""
    budgets = {
        name: budget
        for name, budget in found.items()
        if budget is not None and readings[name].value is not None
    }
    told = {name: stated(reading, budgets.get(name)) for name, reading in readings.items()}
    return told, budgets


def stated(reading: Reading, budget: Budget | None) -> Reading:
    """The reading with the uncertainty of a budget, where there is one."""
    if budget is None:
        return reading
    return replace(
        reading,
        u_random=budget.random,
        u_systematic=budget.systematic,
        interval_95=budget.interval,
    )
