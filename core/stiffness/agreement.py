"""Comparison of the results of different stiffness estimators for one bearing.

Errors of the gains and of the bracket's stiffness are common to all estimators and cancel in the
comparison. All other uncertainties in the budgets can explain a difference.
"""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence, Set

import numpy as np

from core.arrays import FloatArray
from core.spectra.cross_spectrum import SHAFT_X, SHAFT_Y, CrossSpectrum
from core.stiffness.dynamic import DynamicStiffness
from core.stiffness.estimators import DYNAMIC_COEFFICIENTS, ESTIMATORS, TRANSFERS
from core.stiffness.stiffness_budget import (
    BEARING_GAIN,
    BRACKET,
    CROSS_COUPLING,
    STATISTICS,
    motion_across,
)
from core.uncertainty import SHAFT_GAIN, Budget, Kind, coverage_factor, random_line, systematic_line

FALSE_ALARM = 1e-6
"""Probability of a false disagreement. A bearing has about 100,000 independent averages of five
minutes per year, with eight comparisons each: about one false disagreement per year."""

COMMON = frozenset({SHAFT_GAIN, BEARING_GAIN, BRACKET})

KNOWN = COMMON | {CROSS_COUPLING}
"""Errors that do not affect a comparison with a film whose cross-coupling is known."""


def disagree(first: Budget, second: Budget, common: Set[str] = COMMON) -> bool:
    """Return whether two results of one quantity differ by more than their uncertainties allow.

    Errors with the names `common` cancel in the difference.
    """
    lines = [line for line in (*first.lines, *second.lines) if line.name not in common]
    limits = sum(
        abs(line.sensitivity) * line.width for line in lines if line.kind is Kind.SYSTEMATIC
    )
    beyond = abs(first.value - second.value) - limits
    if beyond <= 0.0:
        return False
    random = [line for line in lines if line.kind is Kind.RANDOM]
    spread = math.hypot(*(line.contribution for line in random))
    return beyond > coverage_factor(random, 1.0 - FALSE_ALARM) * spread


def contradicting(
    budgets: Mapping[str, Budget],
    found: DynamicStiffness | None,
    orders: CrossSpectrum,
    lines: Mapping[str, int],
) -> set[str]:
    """Return the names of the quantities whose estimators disagree.

    The estimator `transfer` is compared with its expected value for the film that `dynamic` fitted.
    Without such a film, the results of `transfer` at the lines are compared with each other.

    Parameters
    ----------
    budgets
        Uncertainty budgets of all stiffnesses and dampings, by quantity.
    found
        Film that the estimator `dynamic` fitted; None if it has no result.
    orders
        Cross-spectrum at the lines of 1× and of the vortex.
    lines
        Index of each line in `orders`, by the prefix of its quantities, "order1" or "vortex".
    """
    doubted: set[str] = set()
    for row, (axes, along) in enumerate((("xx", SHAFT_X), ("yy", SHAFT_Y))):
        at_lines = {
            prefix: (budgets[names[0]], budgets[names[1]])
            for prefix in lines
            if (names := ESTIMATORS[TRANSFERS[prefix]].names(axes))[1] in budgets
        }
        if found is None:
            if len(at_lines) > 1 and any(
                itertools.starmap(disagree, zip(*at_lines.values(), strict=True))
            ):
                doubted = doubted.union(*(_of_line(budgets, prefix, axes) for prefix in lines))
            continue
        of_row = DYNAMIC_COEFFICIENTS[row]
        if not all(name in budgets for name in of_row):
            continue
        film, covariance = [budgets[name] for name in of_row], found.covariance[row]
        for prefix, measured in at_lines.items():
            # expected result of `transfer` at the line from the film of `dynamic`
            across = motion_across(orders, lines[prefix], along)
            omega = 2.0 * math.pi * float(orders.frequency_hz[lines[prefix]])
            motion = [1.0 + 0.0j, across] if row == 0 else [across, 1.0 + 0.0j]
            factors = np.array([*motion, *(1j * omega * each for each in motion)])
            parts = np.array([factors.real, factors.imag / omega])
            expected = _combined(film, parts, covariance)
            if any(map(disagree, expected, measured, itertools.repeat(KNOWN))):
                doubted |= _of_line(budgets, prefix, axes) | {*of_row, f"dynamic_ck_{axes}_s"}
    return doubted


def _of_line(names: Iterable[str], prefix: str, axes: str) -> set[str]:
    return {name for name in names if name.startswith(prefix) and f"_{axes}_" in name}


def _combined(
    budgets: Sequence[Budget], factors: FloatArray, covariance: FloatArray
) -> list[Budget]:
    """Return the budgets of n sums of four coefficients, each multiplied by its factor (n, 4).

    Contributions with the names `KNOWN` are left out.
    """
    systematic = [
        [line for line in b.lines if line.kind is Kind.SYSTEMATIC and line.name not in KNOWN]
        for b in budgets
    ]
    names, widths = [line.name for line in systematic[0]], [line.width for line in systematic[0]]
    values = factors @ [budget.value for budget in budgets]
    sensitivities = factors @ [[line.sensitivity for line in lines] for lines in systematic]
    std = np.sqrt(np.einsum("ni,ij,nj->n", factors, covariance, factors))
    return [
        Budget(value, (random_line(STATISTICS, each), *map(systematic_line, names, widths, per)))
        for value, each, per in zip(
            values.tolist(), std.tolist(), sensitivities.tolist(), strict=True
        )
    ]
