"""Limits for changes of film stiffness, and monitoring rules for the films of a unit."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from core.baseline.history import QUANTITIES
from core.condition.cells import CellGrid
from core.condition.operating_state import OperatingLimits
from core.machine.unit import Estimator

REFERENCE_H = 4.0
MIN_SIGNIFICANCE = 3.0
"""Smallest required significance, which applies to long time scales."""

ALERT_MARGIN, DANGER_MARGIN = 1.0, 3.0
"""Number of standard uncertainties by which a change must exceed its limit. A loss of 5 % must be
detected within two weeks, with an uncertainty of 0.7 %. An alert is raised long before a
danger."""


def percent_of(ln: float) -> float:
    """Return a change `ln` of a logarithm in percent of the expected value."""
    return 100.0 * math.expm1(ln)


@dataclass(frozen=True)
class ChangeLimits:
    """Limits of the change of a quantity of a film, for increase and decrease.

    Changes and `deadband` are fractions of the expected value: 0.035 is 3.5 %.

    Parameters
    ----------
    alert_change
        Absolute change for an alert; to be exceeded by `ALERT_MARGIN` standard uncertainties.
    danger_change
        Absolute change for a danger; to be exceeded by `DANGER_MARGIN` standard uncertainties.
    deadband
        Distance below the limit at which an active level ends. The required significance for
        holding a level is lower by the fraction `deadband / alert_change`.
    significance
        Required significance of a mean deviation over four hours, in standard uncertainties.
    significance_fall
        Reduction of the required significance for each fourfold longer time scale. Means over
        longer time have fewer independent values, and so fewer false alarms.
    min_evidence_h
        Running hours with a baseline before a film is reported as normal. A time scale is used
        once it has elapsed.
    on_delay_h
        Uninterrupted running hours with a change before a level becomes active.
    off_delay_h
        Uninterrupted running hours without the change before a level ends.
    """

    alert_change: float = 0.035
    danger_change: float = 0.15
    deadband: float = 0.01
    significance: float = 6.0
    significance_fall: float = 0.7
    min_evidence_h: float = 4.0
    on_delay_h: float = 1.0
    off_delay_h: float = 8.0

    @property
    def holding_share(self) -> float:
        """Fraction of the required significance at or below which an active level ends."""
        return 1.0 - self.deadband / self.alert_change

    def significance_threshold(self, time_scale_h: float) -> float:
        """Return the required significance of a mean deviation over a time scale.

        It is at least `MIN_SIGNIFICANCE`.
        """
        fall = self.significance_fall * math.log(time_scale_h / REFERENCE_H, 4.0)
        return max(self.significance - fall, MIN_SIGNIFICANCE)


CK_CHANGE = ChangeLimits(alert_change=0.008, danger_change=0.05, deadband=0.003)
"""Limits of damping over stiffness, which a change of clearance moves by a third of its size."""


@dataclass(frozen=True)
class FilmRules:
    """Rules for monitoring the films of one unit.

    Parameters
    ----------
    estimators
        Estimator of the monitored stiffness, by bearing id; other bearings are not monitored.
    change, change_ck
        Limits of stiffness, and of damping over stiffness.
    reading_ns
        Interval between readings.
    time_lapse
        Factor by which time passes faster for operating state and decision; above 1 only in
        demonstrations.
    """

    estimators: Mapping[str, Estimator]
    grid: CellGrid
    operating: OperatingLimits
    change: ChangeLimits
    reading_ns: int
    time_lapse: float = 1.0
    change_ck: ChangeLimits = CK_CHANGE

    def limits(self, quantity: str) -> ChangeLimits:
        """Return the limits of a quantity, a key of `QUANTITIES`."""
        return self.change if QUANTITIES[quantity].value == "ln_k" else self.change_ck

    def lapsed_ns(self, time_ns: int) -> int:
        """Return a time multiplied by `time_lapse`, for operating state and decision."""
        return time_ns if self.time_lapse == 1.0 else round(time_ns * self.time_lapse)
