"""Uncertainty of a result as a budget (JCGM 100:2008, "GUM"), random and systematic kept apart.

Random contributions differ from one averaging time to the next; systematic ones stay, and cancel
in a channel's own trend. A budget lists both and combines them.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from scipy.special import ndtri, stdtrit

CONFIDENCE = 0.95


class Distribution(StrEnum):
    """What is known about a contribution besides its width."""

    NORMAL = "normal"
    UNIFORM = "uniform"


class Kind(StrEnum):
    """Whether a contribution is drawn anew in every averaging time."""

    RANDOM = "random"
    SYSTEMATIC = "systematic"


@dataclass(frozen=True)
class BudgetLine:
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
    """A result with everything that makes it uncertain."""

    value: float
    lines: tuple[BudgetLine, ...]

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
        return _interval(self.value, self.lines)

    @property
    def random_interval(self) -> tuple[float, float]:
        """The same if transducers and bracket were known exactly."""
        return _interval(self.value, [line for line in self.lines if line.kind is Kind.RANDOM])


@dataclass(frozen=True)
class BearingAccuracy:
    """How well a bearing's transducers and bracket are known: half-widths, uniform, as shares.

    Parameters
    ----------
    shaft_gain
        Class of the proximity probes, target material and mounting included.
    bearing_gain
        Class of the accelerometers or velocity transducers.
    bracket_stiffness
        Of the k_b that was measured or calculated.
    bracket_mass
        Of the mass, where one is given.
    bracket_damping
        Of the bracket, as a share of critical damping. Bolted and welded steel at working stress
        has 0.02 to 0.03 (Newmark and Hall 1982, table 1).
    delay_s
        Of the delay between shaft and bearing channels, in s. Converters that sample together and
        have the same filters stay within a tenth of a sample at 600 Hz.
    cross_coupling
        Cross-coupled over direct dynamic stiffness of the film, where it is not known: 0.33 to 1.11
        in Brito et al., Table 4.
    probe_noise
        Of the noise density that is taken off the shaft spectra.
    """

    shaft_gain: float = 0.05
    bearing_gain: float = 0.05
    bracket_stiffness: float = 0.10
    bracket_mass: float = 0.2
    bracket_damping: float = 0.02
    delay_s: float = 2e-4
    cross_coupling: float = 0.3
    probe_noise: float = 0.2

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0.0 <= value < 1.0:
                raise ValueError(f"{name} must be a half-width from 0 to below 1, got {value}")


def random_line(name: str, standard: float, freedoms: float = math.inf) -> BudgetLine:
    """Contribution of spectral statistics, in the unit of the result."""
    return BudgetLine(name, Kind.RANDOM, Distribution.NORMAL, standard, 1.0, freedoms)


def systematic_line(name: str, half_width: float, sensitivity: float) -> BudgetLine:
    """Contribution of which only limits are known."""
    return BudgetLine(name, Kind.SYSTEMATIC, Distribution.UNIFORM, half_width, sensitivity)


def coverage_factor(lines: Sequence[BudgetLine], confidence: float = CONFIDENCE) -> float:
    """Half-width of an interval, by default of 95 %, over the combined standard uncertainty.

    Student's distribution with the effective degrees of freedom of Welch and Satterthwaite (GUM,
    G.4.1); 1.96 when all widths are known.
    """
    fourth = sum(line.contribution**4 / line.freedoms for line in lines)
    freedoms = _root_sum(lines) ** 4 / fourth if fourth > 0.0 else math.inf
    quantile = 0.5 + confidence / 2.0
    return float(ndtri(quantile) if math.isinf(freedoms) else stdtrit(freedoms, quantile))


def _interval(value: float, lines: Sequence[BudgetLine]) -> tuple[float, float]:
    half = coverage_factor(lines) * _root_sum(lines)
    return value - half, value + half


def _root_sum(lines: Iterable[BudgetLine]) -> float:
    return math.sqrt(sum(line.contribution**2 for line in lines))
