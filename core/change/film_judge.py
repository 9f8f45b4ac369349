"""`FilmJudge`: comparison of a unit's film readings with baselines, and decisions on each film."""

import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from core.arrays import FloatArray
from core.baseline.baseline import BearingBaseline, QuantityBaseline
from core.baseline.history import DIRECTIONS, QUANTITIES, are_ratios
from core.change.cause import Attribution, Cause, UnitReadings, attribute
from core.change.damping_cause import cause_by_damping, line_finding
from core.change.decision import INITIAL_DECISION, JUDGED, Decision, Verdict, outcomes, step
from core.change.evidence import Finding
from core.change.film_reading import FilmReading
from core.change.settings import ChangeLimits, FilmRules, percent_of
from core.change.shaft_line import WINDOWS, LineFinding, LineVerdict
from core.change.shaft_response import MEAN_READINGS, FilmDirection, ShaftResponse
from core.condition.operating_state import OilSettling, Operation
from core.limits import AlarmLevel, Judgement, unknown

NORMAL_95 = 1.96
"""Half-width of the 95 % interval of a normal distribution, in standard deviations."""


@dataclass(frozen=True)
class FilmFinding:
    """Verdict on a quantity of a film after a reading; fields are None if unknown.

    Parameters
    ----------
    level
        Active level, whether or not this reading was judged.
    change, change_std
        Mean deviation of the quantity from the baseline, in ln, over the averaging time for which
        it is most significant, and its standard uncertainty.
    time_scale_h
        Averaging time of `change` in running hours.
    deviation, deviation_std
        Deviation of this reading from the baseline, in ln, and its standard uncertainty; None if it
        was not compared.
    attribution
        Cause of the change while a level is active, otherwise None.
    quantity
        Name of the quantity, a key of `QUANTITIES`.
    limit
        Limit of the change for danger if that level is active, otherwise for an alert.
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
    quantity: str = "k_x"
    limit: float = ChangeLimits.alert_change

    @property
    def rank(self) -> tuple[int, float]:
        """Sort key of findings: level (0 for none), then absolute change relative to the limit."""
        return self.level or 0, abs(math.expm1(self.change or 0.0)) / self.limit

    def in_alert(self) -> "FilmFinding":
        """Return this finding with at least the level alert."""
        if self.level is not None:
            return self
        verdict = Verdict.ALERT if self.verdict is Verdict.NORMAL else self.verdict
        return replace(self, level=AlarmLevel.ALERT, verdict=verdict)

    @property
    def deviation_95_percent(self) -> tuple[float, float] | None:
        """95 % interval of the deviation in percent of the expected value; None if unknown."""
        if self.deviation is None or self.deviation_std is None:
            return None
        half = NORMAL_95 * self.deviation_std
        return percent_of(self.deviation - half), percent_of(self.deviation + half)


def unjudged(verdict: Verdict) -> tuple[FilmFinding, ...]:
    """Return findings on all `QUANTITIES` with the same verdict and without numbers."""
    return tuple(FilmFinding(verdict, quantity=name) for name in QUANTITIES)


ALARM_REASONS = {
    Cause.FILM: "film_changed",
    Cause.OIL: "oil_changed",
    Cause.CLEARANCE: "clearance_changed",
    Cause.BRACKET: "bracket_changed",
    Cause.TRANSDUCER: "transducer_changed",
    Cause.BRACKET_OR_TRANSDUCER: "bracket_or_transducer_changed",
    Cause.UNKNOWN: "changed_cause_unknown",
}
"""Reason code of a film-stiffness alarm, by cause of the change."""


def alarm_condition(findings: Sequence[FilmFinding], direction: str) -> Judgement:
    """Return the judgement of a film in one direction from the findings of all `QUANTITIES`.

    Value, limit and reason are those of the quantity with the highest level or, at equal levels,
    with the largest change relative to its limit. The judgement is unknown if the stiffness was not
    judged. Damping over stiffness counts only if it was judged, or its level is active.

    Value and limit are changes in percent of the expected value, with the sign of the change.
    """
    stiffness, ck = (f for f in findings if QUANTITIES[f.quantity].direction == direction)
    judged = [each for each in (stiffness, ck) if each.verdict in JUDGED]
    over = [each for each in judged if each.level is not None]
    silent = [each for each in (stiffness, ck) if each.verdict not in JUDGED]
    held = [each for each in silent if each is stiffness or each.level is not None]
    if held and not over:
        return unknown(held[0].verdict.name.lower())
    finding = max(judged, key=lambda each: each.rank)
    level = max(filter(None, (each.level for each in (stiffness, ck))), default=None)
    reason = "ok"
    if finding.level is not None:
        reason = ALARM_REASONS[finding.attribution.cause if finding.attribution else Cause.UNKNOWN]
    change = None if finding.change is None else percent_of(finding.change)
    signed = math.copysign(round(100.0 * finding.limit, 6), change or 0.0)
    return Judgement(level, value=change, limit=signed, reason=reason)


@dataclass(frozen=True)
class FilmDecision:
    """Decision on a quantity of a film, and version of its baseline (None without baseline)."""

    bearing: str
    quantity: str
    version: int | None
    decision: Decision


@dataclass(frozen=True)
class FilmMemory:
    """State of `FilmWatch`, beyond the stored readings, from which another process continues.

    `oil` is the oil settling by bearing id. `slot` is the number of the newest reading interval
    since 1970; the next reading is due in a later interval.
    """

    operation: Operation
    oil: Mapping[str, OilSettling]
    slot: int | None
    decided: tuple[FilmDecision, ...]


@dataclass(frozen=True)
class FilmNews:
    """New reading of a film, with the resulting findings and decisions on all `QUANTITIES`."""

    reading: FilmReading
    findings: tuple[FilmFinding, ...]
    decisions: tuple[Decision, ...]

    @property
    def worst(self) -> int:
        """Index of the finding with the highest level; at equal levels, with the largest change."""
        ranks = [each.rank for each in self.findings]
        return ranks.index(max(ranks))


MAX_RECENT = WINDOWS[-1]
"""Number of newest reading times kept to find causes: six days."""


class FilmJudge:
    """Detector of stiffness changes in the films of one unit; holds baselines and decisions.

    `brackets_n_per_m` is the bracket stiffness by bearing id, None if unknown.

    `response` is the shaft response used to find causes; None if it has not been learned.
    """

    def __init__(self, rules: FilmRules, brackets_n_per_m: Mapping[str, float | None]) -> None:
        self.response: ShaftResponse | None = None
        self._rules = rules
        self._baselines: dict[str, BearingBaseline] = {}
        self._decisions: dict[tuple[str, str], Decision] = {}
        self._films = [(bearing, d) for bearing in rules.estimators for d in DIRECTIONS]
        self._brackets_n_per_m = brackets_n_per_m
        known = [k for bearing, _ in self._films if (k := brackets_n_per_m[bearing]) is not None]
        self._brackets = np.array(known) if len(known) == len(self._films) else None
        self._recent: deque[FloatArray] = deque(maxlen=MAX_RECENT)
        self._gains: dict[str, LineFinding] = {}

    def baseline(self, bearing: str) -> BearingBaseline | None:
        """Return the active baseline of a bearing; None if it has none."""
        return self._baselines.get(bearing)

    def activate_baseline(
        self, bearing: str, baseline: BearingBaseline | None, decisions: Sequence[Decision] = ()
    ) -> None:
        """Set the active baseline of a bearing from the next reading on; None removes it.

        `decisions` on all `QUANTITIES` are those to continue from; by default, initial decisions.
        Their times are cleared, so that the next reading may have any time. A baseline learned
        before the bracket stiffness became known or unknown is not comparable and counts as None.
        """
        if baseline is None or not self._is_comparable(baseline):
            self._baselines.pop(bearing, None)
        else:
            self._baselines[bearing] = baseline
        begun = decisions or (INITIAL_DECISION,) * len(QUANTITIES)
        for name, decision in zip(QUANTITIES, begun, strict=True):
            self._decisions[bearing, name] = _timeless(decision)  # clocks may differ

    @property
    def decided(self) -> tuple[FilmDecision, ...]:
        """Decisions on all quantities of all films, with the versions of their baselines."""
        return tuple(
            FilmDecision(bearing, name, self._version(bearing), decision)
            for (bearing, name), decision in self._decisions.items()
        )

    def restore(self, decided: Sequence[FilmDecision]) -> None:
        """Restore the decisions that were made with the active baselines; ignore all others."""
        for found in decided:
            if found.version == self._version(found.bearing):
                self._decisions[found.bearing, found.quantity] = found.decision

    def forget_times(self) -> None:
        """Clear the times of the last readings, so that the next reading may have any time."""
        self._decisions = {film: _timeless(each) for film, each in self._decisions.items()}

    def add_recent(self, columns: Iterable[FloatArray]) -> None:
        """Add settled readings of earlier times, to find the causes of changes.

        Each item holds one time: (9, n_films), with the rows of `UnitReadings.of`. Only the
        newest `MAX_RECENT` times are kept.
        """
        self._recent.extend(columns)

    def judge(self, readings: Sequence[FilmReading]) -> list[FilmNews]:
        """Compare readings of one time with the baselines, and update the decision on each film.

        Returns
        -------
        One item per reading, in the same order, with findings and updated decisions on all
        `QUANTITIES`.

        Raises
        ------
        ValueError
            If a reading is not later than the previous reading of its film.
        """
        found = {
            (reading.bearing, name): self._decide(reading, name)
            for reading in readings
            for name in QUANTITIES
        }
        self._remember(readings, found)
        lines = self._lines()
        for direction, line in self._gains.items():
            key = str(line.bearing), f"k_{direction}"
            if key in found:
                found[key] = found[key].in_alert()
        for (bearing, name), finding in found.items():
            if finding.level is not None:
                film = bearing, QUANTITIES[name].direction
                cause = self._attribution(film, lines)
                found[bearing, name] = replace(finding, attribution=cause)
        news = []
        for reading in readings:
            keys = [(reading.bearing, name) for name in QUANTITIES]
            findings = tuple(found[key] for key in keys)
            news.append(FilmNews(reading, findings, tuple(self._decisions[key] for key in keys)))
        return news

    def _decide(self, reading: FilmReading, name: str) -> FilmFinding:
        key, quantity, limits = (reading.bearing, name), QUANTITIES[name], self._rules.limits(name)
        learned, before = self._learned(*key), self._decisions.get(key, INITIAL_DECISION)
        own, columns = reading.values[quantity.row], (quantity.value, quantity.uncertainty)
        value, u_random, code = (np.array([getattr(own, x)]) for x in (*columns, "outcome"))
        is_settled = np.array([reading.condition.is_settled])
        [outcome] = outcomes(reading.conditions, value, u_random, code, is_settled, learned)
        now_ns = self._rules.lapsed_ns(reading.time_ns)
        decision = step(before, now_ns, outcome, learned, limits)
        self._decisions[key] = decision
        finding, is_compared = decision.finding, decision.last_counted_ns == decision.last_ns
        is_danger = decision.level is AlarmLevel.DANGER
        return FilmFinding(
            quantity=name,
            limit=limits.danger_change if is_danger else limits.alert_change,
            verdict=decision.verdict,
            level=decision.level,
            change=finding.change if finding else None,
            change_std=finding.std if finding else None,
            time_scale_h=finding.time_scale_h if finding else None,
            deviation=decision.deviation if is_compared else None,
            deviation_std=decision.deviation_std if is_compared else None,
            baseline_version=self._version(reading.bearing),
        )

    def _remember(
        self, readings: Sequence[FilmReading], found: Mapping[tuple[str, str], FilmFinding]
    ) -> None:
        """Keep the readings of one time to find causes, if all bearings have a settled reading."""
        settled = {each.bearing: each for each in readings if each.condition.is_settled}
        if settled.keys() != self._rules.estimators.keys():
            return
        rows = []
        for bearing, direction in self._films:
            stiffness = f"k_{direction}"
            reading, learned = settled[bearing], self._learned(bearing, stiffness)
            value = reading.values[DIRECTIONS.index(direction)]
            deviation = found[bearing, stiffness].deviation
            rows.append(
                (
                    value.ln_k,
                    math.log(value.shaft_um_pk) if value.shaft_um_pk > 0.0 else np.nan,
                    np.nan if deviation is None else deviation,
                    learned.eccentricity_rise(reading.conditions)[0] if learned else np.nan,
                    reading.attitude_deg,
                    *(part for each in value.motion_um for part in (each.real, each.imag)),
                )
            )
        self._recent.append(np.array(rows).T)

    def _lines(self) -> Mapping[str, LineFinding]:
        """Return the findings by the lines of the shaft; update the gains that are in alarm."""
        if not self._recent or self.response is None or not self.response.lines:
            return {}
        readings = UnitReadings.of(np.stack(self._recent, axis=-1))
        lines = {d: line_finding(d, self.response, readings) for d in DIRECTIONS}
        for direction, line in lines.items():
            if line.is_alarming:
                self._gains[direction] = line
            elif line.verdict is not LineVerdict.BROKEN:
                self._gains.pop(direction, None)
        return lines

    def _attribution(self, film: FilmDirection, lines: Mapping[str, LineFinding]) -> Attribution:
        """Return the cause of a film's change, from its newest readings that have a deviation."""
        row = self._films.index(film)
        newest = [column for column in self._recent if np.isfinite(column[2, row])]
        columns = newest[-MEAN_READINGS:] or [np.full((9, len(self._films)), np.nan)]
        readings = UnitReadings.of(np.stack(columns, axis=-1))
        found = attribute(film, self.response, readings, self._brackets)
        places = [(bearing, name) for bearing in self._rules.estimators for name in QUANTITIES]
        return cause_by_damping(
            film, found, {each: self._findings(*each) for each in places}, lines
        )

    def _findings(self, bearing: str, name: str) -> Sequence[Finding]:
        """Return the mean deviations of a quantity of a film over each time scale."""
        learned = self._learned(bearing, name)
        return self._decisions[bearing, name].evidence.findings(learned) if learned else ()

    def _is_comparable(self, baseline: BearingBaseline) -> bool:
        stiffness = [each for name in ("k_x", "k_y") if (each := baseline.of(name))]
        cells = [cell.location for each in stiffness for cell in each.table.cells]
        has_bracket = self._brackets_n_per_m[baseline.origin.bearing] is not None
        return bool(np.all(are_ratios(np.array(cells)) != has_bracket))

    def _learned(self, bearing: str, quantity: str) -> QuantityBaseline | None:
        baseline = self._baselines.get(bearing)
        return baseline.of(quantity) if baseline else None

    def _version(self, bearing: str) -> int | None:
        baseline = self._baselines.get(bearing)
        return baseline.origin.version if baseline else None


def _timeless(decision: Decision) -> Decision:
    return replace(decision, last_ns=None, last_counted_ns=None)
