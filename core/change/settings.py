"""How large, how sure and how lasting a change must be."""

import math
from dataclasses import dataclass, fields

import numpy as np

from core.arrays import FloatArray

REFERENCE_H = 4.0
LEAST_SIGNIFICANCE = 3.0
"""However long the time scale."""

ALERT_MARGIN, DANGER_MARGIN = 1.0, 3.0
"""Standard uncertainties by which a change must be beyond its limit. A loss of 5 % must still be
found within two weeks, where means are known to 0.7 %. What becomes a danger has long been an
alert."""


@dataclass(frozen=True)
class ChangeLimits:
    """Limits of the change of a film, in ln (0.035 is 3.5 %), either way.

    Parameters
    ----------
    alert_change, danger_change
        Size that a change that is sure must surely exceed to be an alert, or danger.
    deadband
        How far below its limit a change must fall for a level to be left; significance must fall by
        the same share.
    significance, significance_fall
        Standard uncertainties that a mean deviation over four hours must be away from zero to be
        sure, and by how much fewer are enough whenever the time is four times longer: long means
        have fewer occasions to stray.
    min_evidence_h
        Running hours with a baseline before anything is called normal. A time scale counts from its
        own length on.
    on_delay_h, off_delay_h
        Running hours without interruption before a level counts, or counts no longer.
    is_latching
        Whether a level stays until it is released.

    Raises
    ------
    ValueError
        With key and value, if one is not a number above zero, alert is not below danger, or the
        deadband is not below the alert limit.
    """

    alert_change: float = 0.035
    danger_change: float = 0.15
    deadband: float = 0.01
    significance: float = 6.0
    significance_fall: float = 0.7
    min_evidence_h: float = 4.0
    on_delay_h: float = 1.0
    off_delay_h: float = 8.0
    is_latching: bool = False

    def __post_init__(self) -> None:
        for key in (field.name for field in fields(self) if field.name != "is_latching"):
            value = getattr(self, key)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{key} = {value:g} must be a number above 0")
        if not self.alert_change < self.danger_change:
            raise ValueError(
                f"alert_change = {self.alert_change:g} must be below"
                f" danger_change = {self.danger_change:g}"
            )
        if not self.deadband < self.alert_change:
            raise ValueError(
                f"deadband = {self.deadband:g} must be below alert_change = {self.alert_change:g}"
            )

    @property
    def holding_share(self) -> float:
        """Share of the significance below which a level is left."""
        return 1.0 - self.deadband / self.alert_change

    def sure_from(self, time_scale_h: float) -> float:
        """Significance from which a mean over a time scale is sure."""
        fall = self.significance_fall * math.log(time_scale_h / REFERENCE_H, 4.0)
        return max(self.significance - fall, LEAST_SIGNIFICANCE)


def sure_size(
    change: FloatArray | float, significance: FloatArray | float, margin: float
) -> FloatArray:
    """Size that a mean deviation surely has: by how much its uncertainty leaves it away from zero.

    Parameters
    ----------
    significance
        Standard uncertainties away from zero; nothing is sure of one that is not above zero.
    margin
        Standard uncertainties that it may be smaller by.
    """
    return np.asarray(np.abs(change) * (1.0 - margin / np.maximum(significance, 1e-9)))
