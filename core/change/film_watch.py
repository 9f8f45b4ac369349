"""`FilmWatch`: follows a unit's operation, and reads its films once in a while."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import groupby

from core.change.film_judge import FilmJudge, FilmNews
from core.change.film_memory import FilmMemory
from core.change.film_reading import FilmReading, film_reading, shown, sure
from core.change.film_rules import FilmRules
from core.condition.cells import BearingCondition, FilmConditions
from core.condition.oil_settling import NOT_AT_SPEED, OilSettling
from core.condition.operating_state import NEVER_SEEN, OperatingReading, Operation, advance
from core.monitor.assessment import Assessment


class FilmWatch:
    """The films of one unit as results come in.

    Parameters
    ----------
    judge
        Says what readings mean.
    """

    def __init__(self, rules: FilmRules, judge: FilmJudge) -> None:
        self.judge = judge
        self._rules = rules
        self._operation = NEVER_SEEN
        self._oil: dict[str, OilSettling] = {}
        self._slot: int | None = None

    @property
    def operation(self) -> Operation:
        """What the unit does now."""
        return self._operation

    def go_on(self, operation: Operation, oil: Mapping[str, OilSettling]) -> None:
        """Go on from what the unit did, and how warm its bearings were, when it was seen last."""
        self._operation, self._oil = operation, dict(oil)

    @property
    def memory(self) -> FilmMemory:
        """What must be known, beside stored readings, to go on from here elsewhere."""
        return FilmMemory(self._operation, dict(self._oil), self._slot, self.judge.decided)

    def resume(self, memory: FilmMemory) -> None:
        """Go on from where another one was; after `go_on` and `FilmJudge.put_in_force`."""
        self.go_on(memory.operation, memory.oil)
        self._slot = memory.slot
        self.judge.resume(memory.decided)

    def take(self, assessments: Sequence[Assessment]) -> tuple[list[Assessment], list[FilmNews]]:
        """Take in what has been found of the bearings.

        Returns
        -------
        The same with the condition that it was found under, and what is said of the films if it
        was time for a reading.
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
            if last_ns - now_ns <= self._rules.operating.longest_gap_ns:
                return  # the same once more, or a clock put back a little
            self._start_again()
        reading = OperatingReading(
            now_ns, shown(readings["speed_rpm"]), shown(readings["power_mw"])
        )
        self._operation = advance(self._operation, reading, self._rules.operating)

    def _start_again(self) -> None:
        """After a clock was put back: what was said stands, but times are new."""
        self.go_on(NEVER_SEEN, {})
        self._slot = None
        self.judge.forget_times()

    def _condition(self, assessment: Assessment) -> BearingCondition:
        readings, limits = assessment.readings, self._rules.operating
        oil_c = sure(readings["oil_temperature_c"])
        here = FilmConditions.one(
            sure(readings["eccentricity_ratio"]), oil_c, sure(readings["attitude_angle_deg"])
        )
        grid = self._rules.grid
        cell = tuple(grid.cells(here)[:, 0].tolist()) if grid.is_known(here)[0] else None
        oil = self._oil.get(assessment.bearing, NOT_AT_SPEED).step(self._operation, oil_c, limits)
        self._oil[assessment.bearing] = oil
        is_settled = self._operation.is_settled(limits, oil.has_settled)
        return BearingCondition(self._operation.state, is_settled, cell)

    def _is_time(self, time_ns: int) -> bool:
        """Whether a reading is due; not in the first interval, of which little may be known."""
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
