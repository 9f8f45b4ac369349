"""Shaft displacement from two axes of one or two probes each, separated from thermal growth.

The change d of a gap from its reference contains the shaft displacement u and the thermal growth g
of shaft and housing: d_near = g − u for the probe on the positive axis, d_far = g + u opposite.
"""

from dataclasses import dataclass

import numpy as np

from core.arrays import FloatArray
from core.machine.unit import GapAccuracy
from core.quality import NOT_MEASURED, Quality, Reading, Reason, uncertain, worst
from core.uncertainty import Budget, BudgetLine, random_line, systematic_line

NAMES = ("gap x", "opposite gap x", "gap y", "opposite gap y", "thermal growth", "uneven growth")
"""Names of the input quantities from which a displacement is computed; all are lengths in µm."""

GROWTH, ASYMMETRY = 4, 5
"""Indices of the input quantities that are not gaps."""

UNITS: tuple[FloatArray, ...] = tuple(np.eye(len(NAMES)))
"""Weights (6,) of each input quantity alone."""


@dataclass(frozen=True)
class ProbeAxis:
    """Mean gaps in µm on an axis, of the probe on the positive side (near) and opposite (far).

    The references are the gaps with the shaft centred. `far` is None without an opposite probe.
    """

    near: Reading
    near_reference_um: float
    far: Reading | None = None
    far_reference_um: float = 0.0

    @property
    def has_both(self) -> bool:
        """Whether both gaps are known."""
        return self.near.value is not None and self.far is not None and self.far.value is not None

    @property
    def changes_um(self) -> tuple[float, float]:
        """Changes of the near and far gaps from their references; 0 if unknown."""
        near, far = self.near.value, self.far.value if self.far is not None else None
        return (
            0.0 if near is None else near - self.near_reference_um,
            0.0 if far is None else far - self.far_reference_um,
        )

    @property
    def quality(self) -> Quality:
        """Worst quality of the known gaps; at best uncertain if one of two gaps is unknown."""
        if self.far is None:
            return self.near.quality
        if (self.near.value is None) == (self.far.value is None):
            return worst((self.near.quality, self.far.quality))
        left = self.far if self.near.value is None else self.near
        return worst((left.quality, uncertain(Reason.REDUCED_PROBES)))


class ProbeAxes:
    """Shaft displacement along x and y, as weighted sums of six input quantities.

    `last` is the last measured thermal growth in µm; None if it was never measured.

    Attributes
    ----------
    values_um
        Gap changes, last measured growth and growth asymmetry (6,), in the order of `NAMES`.
    weights
        Weights of `values_um` in the displacement along x and y (2, 6); 0 along an axis whose
        displacement is unknown.
    """

    def __init__(
        self, x: ProbeAxis, y: ProbeAxis, accuracy: GapAccuracy, last: Reading | None
    ) -> None:
        self._axes, self._accuracy = (x, y), accuracy
        self._last = last or NOT_MEASURED
        outside_um = self._last.value or 0.0
        self.values_um: FloatArray = np.array([*x.changes_um, *y.changes_um, outside_um, 0.0])
        self.weights: FloatArray = np.array([self._displacement(0), self._displacement(1)])

    @property
    def growth_quality(self) -> Quality:
        """Quality of the thermal growth measured now; good if no axis has both gaps."""
        return worst(axis.quality for axis in self._axes if axis.has_both)

    def growth_budget(self) -> Budget | None:
        """Return the budget of the thermal growth; None if no axis has both gaps."""
        both = [axis for axis in (0, 1) if self._axes[axis].has_both]
        if not both:
            return None
        weights = np.mean([self._own_growth(axis) for axis in both], axis=0)
        return Budget(float(weights @ self.values_um), self.lines(weights))

    def lines(self, weights: FloatArray) -> tuple[BudgetLine, ...]:
        """Return the budget lines of the sum of `values_um` with `weights` (6,) (GUM, eq. 10)."""
        return tuple(
            line
            for source, weight in enumerate(weights.tolist())
            if weight != 0.0
            for line in self._lines(source, weight)
        )

    def _lines(self, source: int, weight: float) -> list[BudgetLine]:
        accuracy, name = self._accuracy, NAMES[source]
        if source == GROWTH:
            half_width_um = accuracy.growth_um
            if self._last.interval_95 is not None:
                low_um, high_um = self._last.interval_95
                half_width_um = (high_um - low_um) / 2.0 + accuracy.growth_change_um
            return [systematic_line(name, half_width_um, weight)]
        if source == ASYMMETRY:
            return [systematic_line(name, accuracy.growth_asymmetry_um, weight)]
        gain_um = accuracy.gain * abs(float(self.values_um[source]))
        axis = self._axes[source // 2]
        gap = axis.far if source % 2 else axis.near
        noise_um = 0.0 if gap is None else gap.u_random or 0.0
        return [
            systematic_line(f"gain of {name}", gain_um, weight),
            systematic_line(f"reference of {name}", accuracy.reference_um, weight),
            random_line(f"scatter of {name}", abs(weight) * noise_um),
        ]

    def _displacement(self, axis: int) -> FloatArray:
        near, far = UNITS[2 * axis : 2 * axis + 2]
        probes = self._axes[axis]
        if probes.has_both:
            return (far - near) / 2.0
        if probes.near.value is not None:
            return self._growth_of(axis) - near
        if probes.far is not None and probes.far.value is not None:
            return far - self._growth_of(axis)
        return np.zeros(len(NAMES))

    def _growth_of(self, axis: int) -> FloatArray:
        """Return the weights of the growth of a one-probe axis: other axis, else last measured."""
        if self._axes[1 - axis].has_both:
            return self._own_growth(1 - axis) + UNITS[ASYMMETRY]
        return UNITS[GROWTH] + axis * UNITS[ASYMMETRY]

    def _own_growth(self, axis: int) -> FloatArray:
        near, far = UNITS[2 * axis : 2 * axis + 2]
        return (near + far) / 2.0
