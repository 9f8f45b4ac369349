"""`FilmWatch`: follows a unit's operation, and reads its films once in a while."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby

from core.assessment import Assessment
from core.condition.bearing_condition import BearingCondition
from core.condition.film_conditions import FilmConditions
from core.condition.operating_state import NEVER_SEEN, OperatingReading, Operation, advance
from core.films.film_judge import FilmJudge, FilmNews
from core.films.film_memory import FilmMemory
from core.films.film_reading import FilmReading, film_reading, shown, sure
from core.films.film_rules import FilmRules


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
        self._slot: int | None = None

    @property
    def operation(self) -> Operation:
        """What the unit does now."""
        return self._operation

    def go_on(self, operation: Operation) -> None:
        """Go on from what the unit did when it was seen last."""
        self._operation = operation

    @property
    def memory(self) -> FilmMemory:
        """What must be known, beside stored readings, to go on from here elsewhere."""
        return FilmMemory(self._operation, self._slot, self.judge.decided)

    def resume(self, memory: FilmMemory) -> None:
        """Go on from where another one was; after `go_on` and `FilmJudge.put_in_force`."""
        self._operation, self._slot = memory.operation, memory.slot
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
        self._operation, self._slot = NEVER_SEEN, None
        self.judge.forget_times()

    def _condition(self, assessment: Assessment) -> BearingCondition:
        readings = assessment.readings
        here = FilmConditions.one(
            sure(readings["eccentricity_ratio"]),
            sure(readings["oil_temperature_c"]),
            sure(readings["attitude_angle_deg"]),
        )
        grid = self._rules.grid
        cell = tuple(grid.cells(here)[:, 0].tolist()) if grid.is_known(here)[0] else None
        is_settled = self._operation.is_settled(self._rules.operating)
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
