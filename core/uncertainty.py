"""Uncertainty budgets with random and systematic contributions (JCGM 100:2008, "GUM").

Random contributions differ from one averaging time to the next. Systematic contributions are
constant and cancel in the trend of a channel. A budget lists and combines both.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from core.arrays import FloatArray
from core.quality import Quality, Reading

CONFIDENCE = 0.95


class Kind(StrEnum):
    """Kind of contribution: random from one averaging time to the next, or systematic.

    Random contributions are normally distributed, systematic ones uniformly.
    """

    RANDOM = "random"
    SYSTEMATIC = "systematic"


# names of a module are found faster than members of an enumeration
_RANDOM, _SYSTEMATIC = Kind


class BudgetLine(NamedTuple):
    """Contribution of one input quantity to the uncertainty of a result.

    Parameters
    ----------
    width
        Standard uncertainty if random, half-width if systematic, in the unit of the input quantity.
    sensitivity
        Change of the result per unit of the input quantity.
    freedoms
        Degrees of freedom of an estimated width; infinite for a stated width.
    """

    name: str
    kind: Kind
    width: float
    sensitivity: float
    freedoms: float = math.inf

    @property
    def distribution(self) -> str:
        """Probability distribution, "normal" or "uniform"."""
        return "normal" if self.kind is _RANDOM else "uniform"

    @property
    def contribution(self) -> float:
        """Standard uncertainty of the result due to this input quantity, in the result's unit."""
        random, systematic, _ = _variances([self])
        return math.sqrt(random + systematic)


@dataclass(frozen=True)
class Budget:
    """Uncertainty budget: a result with all contributions to its uncertainty.

    `bounded_interval` is the 95 % interval of a bounded, non-normal result; None for other results.
    """

    value: float
    lines: tuple[BudgetLine, ...]
    bounded_interval: tuple[float, float] | None = None

    def __reduce__(self) -> tuple[object, ...]:
        # pickling the lines column by column takes a third of the time
        columns = zip(*self.lines, strict=True)
        return _of_columns, (self.value, self.bounded_interval, *columns)

    @property
    def random(self) -> float:
        """Standard uncertainty due to the random contributions."""
        return math.sqrt(_variances(self.lines)[0])

    @property
    def systematic(self) -> float:
        """Standard uncertainty due to the systematic contributions."""
        return math.sqrt(_variances(self.lines)[1])

    @property
    def combined(self) -> float:
        """Combined standard uncertainty (GUM, equation 10)."""
        return math.hypot(self.random, self.systematic)

    @property
    def interval(self) -> tuple[float, float]:
        """95 % coverage interval of the result: lower and upper end."""
        half = coverage_factor(self.lines) * self.combined
        return self.bounded_interval or (self.value - half, self.value + half)

    def reading(self, quality: Quality) -> Reading:
        """Return the result as a reading with its standard uncertainties and interval."""
        random, systematic, fourth = _variances(self.lines)
        combined = random + systematic
        half = _coverage_factor(combined, fourth, CONFIDENCE) * math.sqrt(combined)
        interval = self.bounded_interval or (self.value - half, self.value + half)
        return Reading(self.value, quality, math.sqrt(random), math.sqrt(systematic), interval)


def _of_columns(
    value: float, bounded_interval: tuple[float, float] | None, *columns: Sequence[Any]
) -> Budget:
    """Return a budget from the fields of its lines, as `pickle` stores them."""
    return Budget(value, tuple(map(BudgetLine, *columns)) if columns else (), bounded_interval)


def random_line(name: str, standard: float, freedoms: float = math.inf) -> BudgetLine:
    """Return the budget line of a random contribution with a normal distribution.

    `standard` is its standard uncertainty in the unit of the result, and `freedoms` the degrees of
    freedom of this uncertainty; infinite if it is not estimated from data.
    """
    return BudgetLine(name, _RANDOM, standard, 1.0, freedoms)


def systematic_line(name: str, half_width: float, sensitivity: float) -> BudgetLine:
    """Return a systematic, uniform contribution of an input quantity with the given half-width.

    `sensitivity` is the change of the result per unit of the input quantity.
    """
    return BudgetLine(name, _SYSTEMATIC, half_width, sensitivity)


def coverage_factor(lines: Sequence[BudgetLine], confidence: float = CONFIDENCE) -> float:
    """Return the coverage factor of an interval: half-width over combined standard uncertainty.

    It is the quantile of Student's distribution with the effective degrees of freedom of Welch and
    Satterthwaite (GUM, G.4.1); 1.96 for 95 % if all widths are stated.
    """
    random, systematic, fourth = _variances(lines)
    return _coverage_factor(random + systematic, fourth, confidence)


def _variances(lines: Iterable[BudgetLine]) -> tuple[float, float, float]:
    """Return the random and the systematic variance, and the sum of squares over freedoms."""
    random = systematic = fourth = 0.0
    for _, kind, width, sensitivity, freedoms in lines:
        square = (width * sensitivity) ** 2
        if kind is _RANDOM:
            random += square
        else:
            square /= 3.0  # GUM, 4.3.7
            systematic += square
        fourth += square * square / freedoms
    return random, systematic, fourth


def _coverage_factor(combined: float, fourth: float, confidence: float) -> float:
    """Return the coverage factor for a variance and the sum of its parts' squares by freedoms."""
    freedoms = combined**2 / fourth if fourth > 0.0 else math.inf
    return _quantile(freedoms, 0.5 + confidence / 2.0)


@lru_cache(maxsize=256)
def _quantile(freedoms: float, probability: float) -> float:
    """Return a quantile of Student's distribution, or of the normal one for infinite `freedoms`."""
    from scipy.special import ndtri, stdtrit  # slow import, not needed at start

    return float(ndtri(probability) if math.isinf(freedoms) else stdtrit(freedoms, probability))


def proportional(value: float, budget: Budget) -> Budget:
    """Return the budget of a value proportional to the non-zero result of `budget`."""
    factor = value / budget.value
    lines = (line._replace(sensitivity=factor * line.sensitivity) for line in budget.lines)
    return Budget(value, tuple(lines))


SCATTER = "scatter"


MIN_EFFECTIVE = 2.0


def effective_number(values: FloatArray) -> float:
    """Return the effective number of independent values among n values; at least 2 if n >= 2.

    Values of overlapping segments are correlated. The effective number for a first-order process is
    ``n (1 - r) / (1 + r)``, with the correlation r of successive values (Bayley and Hammersley
    1946). A negative r is set to 0.
    """
    if values.size <= MIN_EFFECTIVE:
        return float(values.size)
    return _effective_number(values - values.mean())


def _effective_number(rest: FloatArray) -> float:
    """Return the effective number of values (n,) from their deviations from the mean."""
    power = float(rest @ rest)
    r = max(float(rest[1:] @ rest[:-1]) / power, 0.0) if power > 0.0 else 0.0
    return max(MIN_EFFECTIVE, rest.size * (1.0 - r) / (1.0 + r))


def mean_budget(
    value: float,
    values: Sequence[float] | FloatArray,
    systematic: tuple[BudgetLine, ...] = (),
    sensitivity: float = 1.0,
) -> Budget | None:
    """Return the budget of a mean of correlated values, or of a result derived from the mean.

    Parameters
    ----------
    value
        The mean, or the derived result.
    values : (n,)
        Averaged values, oldest first.
    systematic
        Systematic contributions to add.
    sensitivity
        Change of `value` per unit of the mean.

    Returns
    -------
    Budget; None for fewer than two values, and for constant values: the repeated value of a
    transmitter contains no information about its uncertainty.
    """
    known = np.asarray(values, dtype=np.float64)
    if known.size < MIN_EFFECTIVE or not known.max() > known.min():
        return None
    rest = known - known.sum() / known.size
    n_effective = _effective_number(rest) if known.size > MIN_EFFECTIVE else MIN_EFFECTIVE
    std = math.sqrt(float(rest @ rest) / (known.size - 1))
    standard = abs(sensitivity) * std / math.sqrt(n_effective)
    return Budget(value, (random_line(SCATTER, standard, n_effective - 1.0), *systematic))


def numbers(readings: Sequence[Reading]) -> FloatArray:
    """Return the values of readings (n,), without the readings that have no value."""
    return np.array([r.value for r in readings if r.value is not None], np.float64)


Budgeted = tuple[Reading, Budget | None]
"""Reading with its budget; the budget is None if the uncertainty is unknown."""

Found = tuple[dict[str, Reading], dict[str, Budget]]
"""Readings with their uncertainties, and the known uncertainty budgets, both by quantity."""


def with_budgets(found: Mapping[str, Budgeted], prefix: str = "") -> Found:
    """Return readings with the uncertainties of their budgets, and the budgets, by quantity.

    `prefix` is added to the names of the quantities.
    """
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
