"""By which rules the films of a unit are watched."""

from collections.abc import Mapping
from dataclasses import dataclass

from core.change.settings import ChangeLimits
from core.condition.cells import CellGrid
from core.condition.operating_state import OperatingLimits
from core.machine.unit import Estimator


@dataclass(frozen=True)
class FilmRules:
    """Rules of one unit.

    Parameters
    ----------
    estimators
        Whose stiffness is watched, by bearing; a bearing that is not there is not watched.
    reading_ns
        From one reading to the next.
    time_lapse
        How many times as fast time passes for operation and decision: 1 but in demonstrations.
    """

    estimators: Mapping[str, Estimator]
    grid: CellGrid
    operating: OperatingLimits
    change: ChangeLimits
    reading_ns: int
    time_lapse: float = 1.0

    def lapsed_ns(self, time_ns: int) -> int:
        """A time as operation and decision see it."""
        return time_ns if self.time_lapse == 1.0 else round(time_ns * self.time_lapse)
