"""Whether a bearing's oil has settled since the unit came to speed: how long a film warms up.

After a start the oil warms and clearances close. How long that takes depends on the machine and on
how long it stood still, so that it is read off the oil: it has settled once its temperature has
stayed within a band for some time. Later changes, by load or weather, do not unsettle it: the
temperature is part of the condition that films are compared by.
"""

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray, TimeArray
from core.condition.operating_state import OperatingLimits, Operation

PARTS = 8
"""Parts of the settling time at which the temperature is remembered."""

TimedLevel: TypeAlias = tuple[int, float]
"""Time in ns, and temperature in °C."""


@dataclass(frozen=True)
class OilSettling:
    """The oil of a bearing in one stretch at rated speed.

    Parameters
    ----------
    stretch_ns
        First reading at speed; None while the unit is not at speed.
    levels
        Temperatures over the settling time, oldest first: as old as that, once there is one.
    has_settled
        Whether they lay within the band.
    """

    stretch_ns: int | None = None
    levels: tuple[TimedLevel, ...] = ()
    has_settled: bool = False

    def step(
        self, operation: Operation, oil_temperature_c: float, limits: OperatingLimits
    ) -> "OilSettling":
        """Take in one reading of the oil, after that of the operation; NaN if there is none."""
        now_ns = operation.last_ns
        if now_ns is None or operation.at_speed_from_ns is None:
            return NOT_AT_SPEED
        if operation.at_speed_to_ns != now_ns:
            return self  # the speed is not known now
        settling = self
        if operation.at_speed_from_ns != self.stretch_ns:
            settling = OilSettling(operation.at_speed_from_ns)
        return settling.near(now_ns, oil_temperature_c, limits)

    def near(self, now_ns: int, oil_c: float, limits: OperatingLimits) -> "OilSettling":
        """Take in one temperature within the stretch."""
        if self.has_settled or math.isnan(oil_c):
            return self
        levels, span_ns = self.levels, limits.oil_settling_ns
        if not levels or now_ns - levels[-1][0] >= span_ns // PARTS:
            levels = (*levels, (now_ns, oil_c))
        while len(levels) > 1 and now_ns - levels[1][0] >= span_ns:
            levels = levels[1:]
        seen_c = (oil_c, *(level_c for _, level_c in levels))
        is_near = max(seen_c) - min(seen_c) <= limits.oil_band_c
        has_settled = is_near and now_ns - levels[0][0] >= span_ns
        return OilSettling(self.stretch_ns, levels, has_settled)


NOT_AT_SPEED = OilSettling()


def oil_settled(
    time_ns: TimeArray,
    oil_temperature_c: FloatArray,
    stretch: npt.NDArray[np.int64],
    limits: OperatingLimits,
) -> npt.NDArray[np.bool_]:
    """Whether the oil has settled in each reading of a history, as `OilSettling` finds it.

    Parameters
    ----------
    time_ns, oil_temperature_c : (n,)
    stretch : (n,)
        First row of the stretch at speed that a reading belongs to; -1 if it is not at speed.
    """
    settled = np.zeros(time_ns.size, np.bool_)
    rows = np.flatnonzero(stretch >= 0)
    cuts = np.flatnonzero(np.diff(stretch[rows])) + 1
    for part in np.split(rows, cuts) if rows.size else ():
        settling = NOT_AT_SPEED
        for i, row in enumerate(part.tolist()):
            settling = settling.near(int(time_ns[row]), float(oil_temperature_c[row]), limits)
            if settling.has_settled:
                settled[part[i:]] = True
                break
            if time_ns[row] - time_ns[part[0]] >= limits.warm_up_ns:
                break  # from here on it no longer matters
    return settled
