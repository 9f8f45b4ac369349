"""`FilmJudge`: compares the readings of a unit's films with their baselines."""

import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from core.arrays import FloatArray
from core.baseline.baseline import BearingBaseline, QuantityBaseline
from core.baseline.history import DIRECTIONS, Watched
from core.change.cause import Attribution, Cause, UnitReadings, attribute
from core.change.decision import INITIAL_DECISION, JUDGED, Decision, Verdict, WatchedReadings, step
from core.change.film_reading import FilmReading
from core.change.settings import ChangeLimits, FilmRules
from core.change.shaft_response import MEAN_READINGS, FilmDirection, ShaftResponse
from core.condition.cells import FilmConditions
from core.condition.operating_state import OilSettling, Operation
from core.limits import AlarmLevel, Judgement, unknown


@dataclass(frozen=True)
class FilmFinding:
    """Verdict on a film in one direction after a reading, with its numbers; None where missing.

    Parameters
    ----------
    level
        Level that is held, whether or not this reading could be judged.
    change, change_std, time_scale_h
        Most significant mean deviation from the baseline, in ln; its standard uncertainty; running
        hours that it is averaged over.
    deviation, deviation_std
        Deviation of this reading alone; None unless it was compared.
    baseline_version
        Version of the baseline.
    attribution
        Cause of the change, while a level is held.
    """

    verdict: Verdict
    level: AlarmLevel | None = None
    change: float | None = None
    change_std: float | None = None
    time_scale_h: float | None = None
    deviation: float | None = None
    deviation_std: float | None = None
    baseline_version: int | None = None
    attribution: Attribution | None = None


ALARM_REASONS = {
    Cause.FILM: "film_changed",
    Cause.OIL: "all_films_changed",
    Cause.BRACKET_OR_TRANSDUCER: "bracket_or_transducer_changed",
    Cause.UNKNOWN: "changed_cause_unknown",
}
"""Reason of an alarm by cause."""


def film_finding(decision: Decision, is_compared: bool, version: int | None) -> FilmFinding:
    """Finding of a decision; `is_compared` if its newest reading was compared."""
    finding = decision.finding
    return FilmFinding(
        verdict=decision.verdict,
        level=decision.level,
        change=finding.change if finding else None,
        change_std=finding.std if finding else None,
        time_scale_h=finding.time_scale_h if finding else None,
        deviation=decision.deviation if is_compared else None,
        deviation_std=decision.deviation_std if is_compared else None,
        baseline_version=version,
    )


def alarm_condition(finding: FilmFinding, limits: ChangeLimits) -> Judgement:
    """Judgement of the film's alarm: a film that could not be judged has not returned to normal."""
    if finding.verdict not in JUDGED:
        return unknown(finding.verdict.name.lower())
    limit = limits.danger_change if finding.level is AlarmLevel.DANGER else limits.alert_change
    reason = "ok"
    if finding.level is not None:
        reason = ALARM_REASONS[finding.attribution.cause if finding.attribution else Cause.UNKNOWN]
    return Judgement(finding.level, value=finding.change, limit=limit, reason=reason)


@dataclass(frozen=True)
class FilmDecision:
    """Decision on a bearing in a direction, with the version of its baseline."""

    bearing: str
    direction: str
    version: int | None
    decision: Decision


@dataclass(frozen=True)
class FilmMemory:
    """State of `FilmWatch` that stored readings do not hold.

    Parameters
    ----------
    oil
        By bearing.
    slot
        Number of the newest interval that had its reading.
    """

    operation: Operation
    oil: Mapping[str, OilSettling]
    slot: int | None
    decided: tuple[FilmDecision, ...]


@dataclass(frozen=True)
class FilmNews:
    """A reading with its findings and decisions in x and y."""

    reading: FilmReading
    findings: tuple[FilmFinding, FilmFinding]
    decisions: tuple[Decision, Decision]


MAX_RECENT = 4 * MEAN_READINGS
"""Moments whose readings are kept to find causes: some lack the deviation of a film."""


class FilmJudge:
    """Active baselines and decisions so far of one unit.

    Parameters
    ----------
    brackets_n_per_m
        Stiffness of the bracket of every bearing.
    """

    def __init__(self, rules: FilmRules, brackets_n_per_m: Mapping[str, float]) -> None:
        self._rules = rules
        self._baselines: dict[str, BearingBaseline] = {}
        self._decisions: dict[FilmDirection, Decision] = {}
        self._response: ShaftResponse | None = None
        self._films = [(bearing, d) for bearing in rules.estimators for d in DIRECTIONS]
        self._brackets = np.array([brackets_n_per_m[bearing] for bearing, _ in self._films])
        self._recent: deque[FloatArray] = deque(maxlen=MAX_RECENT)

    def baseline(self, bearing: str) -> BearingBaseline | None:
        """Active baseline of a bearing."""
        return self._baselines.get(bearing)

    def activate_baseline(
        self, bearing: str, baseline: BearingBaseline | None, decisions: Sequence[Decision] = ()
    ) -> None:
        """Compare a bearing with a baseline, or with none, from its next reading on.

        Parameters
        ----------
        decisions
            Decisions in x and y to continue from; by default the initial ones.
        """
        if baseline is None:
            self._baselines.pop(bearing, None)
        else:
            self._baselines[bearing] = baseline
        for direction, decision in zip(
            DIRECTIONS, decisions or (INITIAL_DECISION,) * 2, strict=True
        ):
            # they may come from another clock
            timeless = replace(decision, last_ns=None, last_counted_ns=None)
            self._decisions[bearing, direction] = timeless

    @property
    def decided(self) -> tuple[FilmDecision, ...]:
        """All decisions with the versions of their baselines."""
        return tuple(
            FilmDecision(bearing, direction, self._version(bearing), decision)
            for (bearing, direction), decision in self._decisions.items()
        )

    def restore(self, decided: Sequence[FilmDecision]) -> None:
        """Continue from decisions of the baselines that are active."""
        for found in decided:
            if found.version == self._version(found.bearing):
                self._decisions[found.bearing, found.direction] = found.decision

    def _version(self, bearing: str) -> int | None:
        baseline = self._baselines.get(bearing)
        return baseline.origin.version if baseline else None

    def set_response(self, response: ShaftResponse | None) -> None:
        """Set the shaft response that causes are found with."""
        self._response = response

    def forget_times(self) -> None:
        """Keep the decisions, and accept readings of any later time."""
        for film, decision in self._decisions.items():
            self._decisions[film] = replace(decision, last_ns=None, last_counted_ns=None)

    def add_recent(self, columns: Iterable[FloatArray]) -> None:
        """Add settled readings of earlier moments, (5, n_films) each, the fields of `UnitReadings`.

        Causes are found with the newest of them.
        """
        self._recent.extend(columns)

    def judge(self, readings: Sequence[FilmReading]) -> list[FilmNews]:
        """Judge the readings of all bearings at one moment, and update the decisions."""
        found = {
            (reading.bearing, direction): self._decide(reading, direction)
            for reading in readings
            for direction in DIRECTIONS
        }
        self._remember(readings, found)
        return [self._news(reading, found) for reading in readings]

    def _remember(
        self, readings: Sequence[FilmReading], found: Mapping[FilmDirection, FilmFinding]
    ) -> None:
        """Keep the readings of one moment if they are of every bearing and settled."""
        rows: dict[FilmDirection, tuple[float, ...]] = {}
        for reading in readings if all(r.condition.is_settled for r in readings) else ():
            for direction, value in zip(DIRECTIONS, reading.values, strict=True):
                film = (reading.bearing, direction)
                learned, deviation = self._learned(*film), found[film].deviation
                rows[film] = (
                    value.ln_k,
                    math.log(value.shaft_um_pk) if value.shaft_um_pk > 0.0 else np.nan,
                    np.nan if deviation is None else deviation,
                    learned.eccentricity_rise(_conditions(reading))[0] if learned else np.nan,
                    reading.attitude_deg,
                )
        if set(rows) == set(self._films):
            self._recent.append(np.array([rows[film] for film in self._films]).T)

    def _news(self, reading: FilmReading, found: Mapping[FilmDirection, FilmFinding]) -> FilmNews:
        films = [(reading.bearing, direction) for direction in DIRECTIONS]
        x, y = (
            replace(found[film], attribution=self._attribution(film))
            if found[film].level is not None
            else found[film]
            for film in films
        )
        decision_x, decision_y = (self._decisions[film] for film in films)
        return FilmNews(reading, (x, y), (decision_x, decision_y))

    def _attribution(self, film: FilmDirection) -> Attribution:
        """Cause of a change of a film, from the newest readings that have its deviation."""
        row = self._films.index(film)
        newest = [column for column in self._recent if np.isfinite(column[2, row])]
        columns = newest[-MEAN_READINGS:] or [np.full((5, len(self._films)), np.nan)]
        readings = UnitReadings(*np.stack(columns, axis=-1))
        return attribute(film, self._response, readings, self._brackets)

    def _learned(self, bearing: str, direction: str) -> QuantityBaseline | None:
        baseline = self._baselines.get(bearing)
        return baseline.of(Watched.STIFFNESS, direction) if baseline else None

    def _decide(self, reading: FilmReading, direction: str) -> FilmFinding:
        film, value = (reading.bearing, direction), reading.values[DIRECTIONS.index(direction)]
        watched = WatchedReadings(
            np.array([reading.time_ns]),
            np.array([reading.condition.is_settled]),
            _conditions(reading),
            np.array([value.ln_k]),
            np.array([value.u_random]),
            np.array([value.outcome]),
        )
        learned = self._learned(*film)
        decision = self._decisions.get(film, INITIAL_DECISION)
        for time_ns, outcome in watched.compared(learned):
            now_ns = self._rules.lapsed_ns(time_ns)
            decision = step(decision, now_ns, outcome, learned, self._rules.change)
        self._decisions[film] = decision
        is_compared = decision.last_counted_ns == decision.last_ns
        return film_finding(decision, is_compared, self._version(reading.bearing))


def _conditions(reading: FilmReading) -> FilmConditions:
    return FilmConditions.one(
        reading.eccentricity_ratio, reading.oil_temperature_c, reading.attitude_deg
    )
