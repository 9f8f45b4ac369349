"""Limits of a change, and the rules that the films of a unit are watched by."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from core.condition.cells import CellGrid
from core.condition.operating_state import OperatingLimits
from core.machine.unit import Estimator

REFERENCE_H = 4.0
MIN_SIGNIFICANCE = 3.0
"""Smallest significance that is required, however long the time scale."""

ALERT_MARGIN, DANGER_MARGIN = 1.0, 3.0
"""Standard uncertainties by which a change must exceed its limit. A loss of 5 % must still be
found within two weeks, where means are known to 0.7 %. A danger was an alert long before."""


@dataclass(frozen=True)
class ChangeLimits:
    """Limits of the change of a film, in ln (0.035 is 3.5 %), in both directions.

    Parameters
    ----------
    alert_change, danger_change
        Size that a significant change must exceed, less its margin, to be an alert or a danger.
    deadband
        How far below its limit a change must fall for the level to be left; the required
        significance falls by the same fraction.
    significance, significance_fall
        Required distance of a mean deviation over four hours from zero, in standard uncertainties,
        and how much less is required for each time scale four times longer: longer means have
        fewer occasions to stray.
    min_evidence_h
        Running hours with a baseline before a film is called normal. A time scale counts after its
        own length.
    on_delay_h, off_delay_h
        Running hours without interruption before a level counts, or counts no longer.
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
        """Fraction of the required significance below which a level is left."""
        return 1.0 - self.deadband / self.alert_change

    def significance_threshold(self, time_scale_h: float) -> float:
        """Significance that a mean deviation over a time scale must reach."""
        fall = self.significance_fall * math.log(time_scale_h / REFERENCE_H, 4.0)
        return max(self.significance - fall, MIN_SIGNIFICANCE)


@dataclass(frozen=True)
class FilmRules:
    """Rules that the films of one unit are watched by.

    Parameters
    ----------
    estimators
        Estimator whose stiffness is watched, by bearing; other bearings are not watched.
    reading_ns
        Time from one reading to the next.
    time_lapse
        Speed of time for operation and decision; above 1 in demonstrations only.
    """

    estimators: Mapping[str, Estimator]
    grid: CellGrid
    operating: OperatingLimits
    change: ChangeLimits
    reading_ns: int
    time_lapse: float = 1.0

    def lapsed_ns(self, time_ns: int) -> int:
        """Time as operation and decision count it."""
        return time_ns if self.time_lapse == 1.0 else round(time_ns * self.time_lapse)
