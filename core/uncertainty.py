"""Uncertainty of a result as a budget (JCGM 100:2008, "GUM"), random and systematic kept apart.

Random contributions differ from one averaging time to the next; systematic ones stay, and cancel
in a channel's own trend. A budget lists both and combines them.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri, stdtrit

from core.arrays import FloatArray
from core.quality import Quality, Reading

CONFIDENCE = 0.95


class Distribution(StrEnum):
    """What is known about a contribution besides its width."""

    NORMAL = "normal"
    UNIFORM = "uniform"


class Kind(StrEnum):
    """Whether a contribution changes from one averaging time to the next."""

    RANDOM = "random"
    SYSTEMATIC = "systematic"


class BudgetLine(NamedTuple):
    """One contribution to the uncertainty of a result.

    Parameters
    ----------
    width
        Standard uncertainty if normal, half-width if uniform; in the unit of what contributes.
    sensitivity
        Change of the result per unit of what contributes.
    freedoms
        Degrees of freedom of a width that was itself estimated; infinite if it was stated.
    """

    name: str
    kind: Kind
    distribution: Distribution
    width: float
    sensitivity: float
    freedoms: float = math.inf

    @property
    def standard(self) -> float:
        """Standard uncertainty of what contributes (GUM, 4.3.7)."""
        return (
            self.width / math.sqrt(3.0) if self.distribution is Distribution.UNIFORM else self.width
        )

    @property
    def contribution(self) -> float:
        """Standard uncertainty of the result by this alone, in its unit."""
        return abs(self.sensitivity) * self.standard


@dataclass(frozen=True)
class Budget:
    """A result with everything that makes it uncertain.

    Parameters
    ----------
    bounded_interval
        95 % interval of a result that is not normal because it lies between bounds; None of others.
    """

    value: float
    lines: tuple[BudgetLine, ...]
    bounded_interval: tuple[float, float] | None = None

    @property
    def random(self) -> float:
        """Standard uncertainty by what changes from one averaging time to the next."""
        return _root_sum(line for line in self.lines if line.kind is Kind.RANDOM)

    @property
    def systematic(self) -> float:
        """Standard uncertainty by what stays."""
        return _root_sum(line for line in self.lines if line.kind is Kind.SYSTEMATIC)

    @property
    def combined(self) -> float:
        """Combined standard uncertainty (GUM, equation 10)."""
        return _root_sum(self.lines)

    @property
    def interval(self) -> tuple[float, float]:
        """Interval that holds the truth with 95 %."""
        return self.bounded_interval or _interval(self.value, self.lines)

    def reading(self, quality: Quality) -> Reading:
        """The result with its standard uncertainties and interval."""
        parts = [(line.kind, line.contribution, line.freedoms) for line in self.lines]
        random = math.sqrt(sum(part**2 for kind, part, _ in parts if kind is Kind.RANDOM))
        systematic = math.sqrt(sum(part**2 for kind, part, _ in parts if kind is Kind.SYSTEMATIC))
        half = _half_width([(part, freedoms) for _, part, freedoms in parts])
        interval = self.bounded_interval or (self.value - half, self.value + half)
        return Reading(self.value, quality, random, systematic, interval)


def random_line(name: str, standard: float, freedoms: float = math.inf) -> BudgetLine:
    """Contribution of spectral statistics, in the unit of the result."""
    return BudgetLine(name, Kind.RANDOM, Distribution.NORMAL, standard, 1.0, freedoms)


def systematic_line(name: str, half_width: float, sensitivity: float) -> BudgetLine:
    """Contribution with known limits only, uniformly distributed."""
    return BudgetLine(name, Kind.SYSTEMATIC, Distribution.UNIFORM, half_width, sensitivity)


def coverage_factor(lines: Sequence[BudgetLine], confidence: float = CONFIDENCE) -> float:
    """Half-width of an interval, by default of 95 %, over the combined standard uncertainty.

    Student's distribution with the effective degrees of freedom of Welch and Satterthwaite (GUM,
    G.4.1); 1.96 when all widths are known.
    """
    parts = [(line.contribution, line.freedoms) for line in lines]
    return _coverage_factor(parts, confidence, math.sqrt(sum(part**2 for part, _ in parts)))


def _coverage_factor(parts: Sequence[tuple[float, float]], confidence: float, root: float) -> float:
    """The same of contributions with their degrees of freedom, and the root of their squares."""
    fourth = sum(part**4 / freedoms for part, freedoms in parts)
    freedoms = root**4 / fourth if fourth > 0.0 else math.inf
    quantile = 0.5 + confidence / 2.0
    return float(ndtri(quantile) if math.isinf(freedoms) else stdtrit(freedoms, quantile))


def _half_width(parts: Sequence[tuple[float, float]]) -> float:
    root = math.sqrt(sum(part**2 for part, _ in parts))
    return _coverage_factor(parts, CONFIDENCE, root) * root


def proportional(value: float, budget: Budget) -> Budget:
    """Budget of a value that is in an exactly known proportion to the result of another."""
    factor = value / budget.value
    lines = (line._replace(sensitivity=factor * line.sensitivity) for line in budget.lines)
    return Budget(value, tuple(lines))


def _interval(value: float, lines: Sequence[BudgetLine]) -> tuple[float, float]:
    half = _half_width([(line.contribution, line.freedoms) for line in lines])
    return value - half, value + half


def _root_sum(lines: Iterable[BudgetLine]) -> float:
    return math.sqrt(sum(line.contribution**2 for line in lines))


SCATTER = "scatter"


MIN_EFFECTIVE = 2.0


def effective_number(values: FloatArray) -> float:
    """Number of independent values with as much information as these (n,), at least 2 of 2 or more.

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
    """Uncertainty of a mean of values (n,), oldest first, or of what is calculated from one.

    Returns
    -------
    None where fewer than two values are known, or where they never differ: a transmitter that
    repeats itself does not show how well it measures.
    """
    known = np.asarray(values, dtype=np.float64)
    if known.size < MIN_EFFECTIVE or not np.ptp(known) > 0.0:
        return None
    n_effective = effective_number(known)
    standard = abs(sensitivity) * float(np.std(known, ddof=1)) / math.sqrt(n_effective)
    return Budget(value, (random_line(SCATTER, standard, n_effective - 1.0), *systematic))


def numbers(readings: Sequence[Reading]) -> FloatArray:
    """Of those that have one."""
    return np.array([r.value for r in readings if r.value is not None], np.float64)


Budgeted = tuple[Reading, Budget | None]
"""A reading with its budget; None if its uncertainty is not known."""

Found = tuple[dict[str, Reading], dict[str, Budget]]
"""Readings with their uncertainties, and the budgets of those that have one, by quantity."""


def with_budgets(found: Mapping[str, Budgeted], prefix: str = "") -> Found:
    """State the uncertainty of readings that have a number and a budget, by prefixed name."""
    readings: dict[str, Reading] = {}
    budgets: dict[str, Budget] = {}
    for name, (reading, budget) in found.items():
        if reading.value is None or budget is None:
            readings[prefix + name] = reading
        else:
            budgets[prefix + name] = budget
            readings[prefix + name] = budget.reading(reading.quality)
    return readings, budgets


SHAFT_GAIN = "gain of shaft probe"
