"""`FilmWatch`: operating state of a unit, and film readings taken from it at regular intervals."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import groupby

from core.change.film_judge import FilmJudge, FilmMemory, FilmNews
from core.change.film_reading import FilmReading, film_reading, good_or_nan, value_or_nan
from core.change.settings import FilmRules
from core.condition.cells import BearingCondition, FilmConditions
from core.condition.operating_state import (
    NOT_AT_SPEED,
    UNKNOWN_OPERATION,
    OilSettling,
    Operation,
    step_operation,
)
from core.monitor.assessment import Assessment
from core.units import ns_from_s


class FilmWatch:
    """Monitor of the operating state and the films of one unit, updated from its assessments."""

    def __init__(self, rules: FilmRules, judge: FilmJudge) -> None:
        self.judge = judge
        self._rules = rules
        self._operation = UNKNOWN_OPERATION
        self._oil: dict[str, OilSettling] = {}
        self._slot: int | None = None

    @property
    def operation(self) -> Operation:
        """Operating state of the unit after its newest assessment, with its start time."""
        return self._operation

    @property
    def memory(self) -> FilmMemory:
        """State from which another process continues, in addition to the stored readings."""
        return FilmMemory(self._operation, dict(self._oil), self._slot, self.judge.decided)

    def restore_operation(self, operation: Operation, oil: Mapping[str, OilSettling]) -> None:
        """Restore the operation of the unit, and the oil settling by bearing id."""
        self._operation, self._oil = operation, dict(oil)

    def restore(self, memory: FilmMemory) -> None:
        """Restore the state of another process; the baselines must be activated before."""
        self.restore_operation(memory.operation, memory.oil)
        self._slot = memory.slot
        self.judge.restore(memory.decided)

    def take(self, assessments: Sequence[Assessment]) -> tuple[list[Assessment], list[FilmNews]]:
        """Update the operation and, if a reading is due, the films from new assessments.

        Returns
        -------
        The assessments with their operating conditions added, and the judged film readings; the
        latter list is empty if no reading was due.
        """
        seen: list[Assessment] = []
        news: list[FilmNews] = []
        for time_ns, found in groupby(assessments, key=lambda assessment: assessment.time_ns):
            together = list(found)
            self._operate(together[0])
            seen += (known := [replace(a, condition=self._condition(a)) for a in together])
            if self._is_time(time_ns):
                news += self.judge.judge(self._read(known))
        return seen, news

    def _operate(self, assessment: Assessment) -> None:
        readings = assessment.readings
        now_ns, last_ns = self._rules.lapsed_ns(assessment.time_ns), self._operation.last_ns
        if last_ns is not None and now_ns <= last_ns:
            if last_ns - now_ns <= ns_from_s(self._rules.operating.longest_gap_s):
                return  # repeated assessment, or a clock set back slightly
            # keep the decisions and reset all times after the clock was set back
            self.restore_operation(UNKNOWN_OPERATION, {})
            self._slot = None
            self.judge.forget_times()
        speed_rpm, power_mw = (value_or_nan(readings[key]) for key in ("speed_rpm", "power_mw"))
        self._operation = step_operation(
            self._operation, now_ns, speed_rpm, power_mw, self._rules.operating
        )

    def _condition(self, assessment: Assessment) -> BearingCondition:
        readings, limits = assessment.readings, self._rules.operating
        oil_c = good_or_nan(readings["oil_temperature_c"])
        here = FilmConditions.one(
            good_or_nan(readings["eccentricity_ratio"]),
            oil_c,
            good_or_nan(readings["attitude_angle_deg"]),
        )
        grid = self._rules.grid
        cell = tuple(grid.cells(here)[:, 0].tolist()) if grid.is_known(here)[0] else None
        oil = self._oil.get(assessment.bearing, NOT_AT_SPEED).step(self._operation, oil_c, limits)
        self._oil[assessment.bearing] = oil
        is_settled = self._operation.is_settled(limits, oil.has_settled)
        return BearingCondition(self._operation.state, is_settled, cell)

    def _is_time(self, time_ns: int) -> bool:
        """Whether a reading is due; never in the first interval, which may be incomplete."""
        slot = time_ns // self._rules.reading_ns
        if self._slot is None or slot <= self._slot:
            self._slot = max(slot, self._slot or slot)
            return False
        self._slot = slot
        return True

    def _read(self, assessments: Sequence[Assessment]) -> list[FilmReading]:
        estimators = self._rules.estimators
        return [
            film_reading(assessment, assessment.condition, estimators[assessment.bearing])
            for assessment in assessments
            if assessment.bearing in estimators and assessment.condition is not None
        ]
