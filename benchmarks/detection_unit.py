"""One simulated unit: what is learned from its first year, and what is decided in the second."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from acquisition.simulated.life.damage import Damage
from acquisition.simulated.life.inputs import draw_inputs
from acquisition.simulated.life.life import life_of, live
from acquisition.simulated.life.operation import HeldLoad
from acquisition.simulated.life.shaft import ConditionChange
from acquisition.simulated.life.truth import UnitLife
from acquisition.simulated.plant.rotor import RotorParameters
from benchmarks.detection_fixed import BANDS, FixedThreshold
from core.arrays import FloatArray
from core.baseline.baseline import Origin, QuantityBaseline
from core.baseline.history import DIRECTIONS, QUANTITIES, StiffnessHistory
from core.baseline.learning import learn
from core.baseline.settings import BaselineSettings
from core.change.backtest import DecisionHistory, decide_all, operation_history
from core.change.cause import Attribution, UnitReadings, attribute
from core.change.damping_cause import cause_by_damping, line_finding
from core.change.decision import Verdict, outcomes
from core.change.evidence import NO_EVIDENCE, Finding
from core.change.film_judge import MAX_RECENT
from core.change.settings import ChangeLimits, FilmRules
from core.change.shaft_line import LineFinding
from core.change.shaft_response import MEAN_READINGS, FilmDirection, film_columns, learn_response
from core.condition.operating_state import OperatingLimits

DAY_NS = 86_400 * 10**9
START_NS = 19_723 * DAY_NS
"""Midnight of 1 January 2024."""

YEARS = 2.0
LEARNING_DAYS = 365
BRACKETS_N_PER_M = {b.bearing: b.stiffness_n_per_m for b in RotorParameters().brackets}
SETTINGS = BaselineSettings()
RULES = FilmRules({}, SETTINGS.grid, OperatingLimits(1.0, 1.0), ChangeLimits(), 600 * 10**9)
EVIDENCE_ROWS = 3000
"""Readings from which mean deviations are calculated: three weeks."""


@dataclass(frozen=True, eq=False)
class Later:
    """What comes after the learning period of one life."""

    histories: Mapping[str, StiffnessHistory]
    is_settled: npt.NDArray[np.bool_]

    def rows(self, start: int, stop: int) -> "Later":
        """The readings from row `start` up to `stop`."""
        histories = {bearing: one.rows(start, stop) for bearing, one in self.histories.items()}
        return Later(histories, self.is_settled[start:stop])

    @property
    def time_ns(self) -> npt.NDArray[np.int64]:
        return next(iter(self.histories.values())).time_ns

    @property
    def years(self) -> float:
        return float(self.time_ns[-1] - self.time_ns[0]) / DAY_NS / 365.25


def raised(decided: DecisionHistory) -> npt.NDArray[np.intp]:
    """Rows at which the level is higher than just before."""
    return np.flatnonzero(np.diff(decided.level, prepend=np.int8(0)) > 0)


class LearnedUnit:
    """A unit with its baselines; damage comes to it after it has been learned."""

    def __init__(self, seed: int, held: HeldLoad | None = None) -> None:
        self.seed, self.held = seed, held
        self._inputs = draw_inputs(seed, START_NS, YEARS, held=held)
        life = life_of(self._inputs, (), self._inputs.operation.is_turning)
        settled, n = _settled(life), _n_learning(life)
        learning = {bearing: history.rows(0, n) for bearing, history in life.readings.items()}
        self.baselines = {
            bearing: learn(history, settled[:n], _origin(seed, bearing), SETTINGS)
            for bearing, history in learning.items()
        }
        self.response = learn_response(learning, settled[:n])
        self.fixed = _fixed(life, settled, n)
        self.healthy = _later(life, settled)

    def later(
        self, damage: Iterable[Damage] = (), changes: Iterable[ConditionChange] = ()
    ) -> Later:
        """The same life, damaged or changed; damage alone does not change operation or oil."""
        if changes := tuple(changes):
            life = live(self.seed, START_NS, YEARS, damage, changes, held=self.held)
            return _later(life, _settled(life))
        life = life_of(self._inputs, tuple(damage), self._inputs.operation.is_turning)
        n = _n_learning(life)
        return Later(_rows(life, n), self.healthy.is_settled)

    def decide(self, later: Later, bearing: str, quantity: str) -> DecisionHistory:
        columns = later.histories[bearing], later.is_settled
        learned, limits = self.learned(bearing, quantity), RULES.limits(quantity)
        return decide_all(*columns, quantity, learned, limits)

    def learned(self, bearing: str, quantity: str) -> QuantityBaseline:
        found = self.baselines[bearing].of(quantity)
        if found is None:
            raise RuntimeError(f"unit {self.seed} has learned nothing of {bearing} {quantity}")
        return found

    def watched(self) -> list[tuple[str, str]]:
        """Bearing and name of each quantity that is decided on."""
        return [(bearing, quantity) for bearing in self.baselines for quantity in QUANTITIES]

    def places(self) -> list[FilmDirection]:
        return [(bearing, direction) for bearing in self.baselines for direction in DIRECTIONS]

    def judged_rows(self, bearing: str) -> npt.NDArray[np.int64]:
        """Rows in which the healthy bearing is compared with its baseline in both directions."""
        known = [np.isfinite(self._deviation(self.healthy, bearing, d)) for d in DIRECTIONS]
        return np.flatnonzero(np.logical_and.reduce(known))

    def attribution(self, later: Later, place: FilmDirection, row: int) -> Attribution:
        """What a change at a place is put down to after a row."""
        readings = self.place_readings(later)
        known = np.isfinite(readings.deviation[self.places().index(place), : row + 1])
        newest = readings.columns(np.flatnonzero(known)[-MEAN_READINGS:])
        brackets = np.array([BRACKETS_N_PER_M[bearing] for bearing, _ in self.places()])
        found = attribute(place, self.response, newest, brackets)
        before = later.rows(max(0, row - EVIDENCE_ROWS), row + 1)
        lines = self.lines(later, row)
        evidence = {each: self._findings(before, *each) for each in self.watched()}
        return cause_by_damping(place, found, evidence, lines)

    def lines(self, later: Later, row: int) -> dict[str, LineFinding]:
        """Findings by the lines of the shaft after a row."""
        before = later.rows(max(0, row - 2 * MAX_RECENT), row + 1)
        settled = np.flatnonzero(before.is_settled)[-MAX_RECENT:]
        readings = self.place_readings(before).columns(settled)
        return {d: line_finding(d, self.response, readings) for d in DIRECTIONS}

    def line_alarms(self, later: Later) -> list[tuple[int, str, str | None]]:
        """Row, direction and bearing of the gains that the lines show, asked every four hours."""
        settled = np.flatnonzero(later.is_settled)
        readings, found, active = self.place_readings(later), [], dict[str, str | None]()
        for end in range(MEAN_READINGS, settled.size, MEAN_READINGS):
            newest = readings.columns(settled[max(0, end - MAX_RECENT) : end])
            for d in DIRECTIONS:
                line = line_finding(d, self.response, newest)
                now = line.bearing if line.is_alarming else None
                if now is not None and now != active.get(d):
                    found.append((int(settled[end - 1]), d, now))
                active[d] = now
        return found

    def _findings(self, later: Later, bearing: str, quantity: str) -> list[Finding]:
        history, learned, found = (
            later.histories[bearing],
            self.learned(bearing, quantity),
            NO_EVIDENCE,
        )
        columns = history.conditions, *history.of(quantity), later.is_settled
        for outcome in outcomes(*columns, learned):
            if not isinstance(outcome, Verdict):
                found = found.step(outcome, learned)
        return found.findings(learned)

    def last_change(self, later: Later, bearing: str, quantity: str) -> float:
        """The most significant change after the last reading."""
        found = self._findings(later, bearing, quantity)
        return max(found, key=lambda each: each.significance).change if found else 0.0

    def place_readings(self, later: Later) -> UnitReadings:
        """All of a unit's settled readings."""
        places = [(later.histories[b], self.learned(b, f"k_{d}")) for b, d in self.places()]
        rises = [film.eccentricity_rise(history.conditions) for history, film in places]
        return UnitReadings(
            *film_columns(later.histories),
            np.stack([self._deviation(later, *place) for place in self.places()]),
            np.stack(rises),
            np.stack([history.attitude_deg for history, _ in places]),
            np.concatenate([h.motion_um for h in later.histories.values()], axis=1),
        )

    def _deviation(self, later: Later, bearing: str, direction: str) -> FloatArray:
        history, baseline = later.histories[bearing], self.learned(bearing, f"k_{direction}")
        found = baseline.compare_history(history)
        return np.where(later.is_settled, found.deviation, np.nan)


def fixed_false_alarms(seed: int) -> tuple[float, list[int]]:
    """Years of a healthy unit after learning, and how often a fixed threshold alarms, by band."""
    life = live(seed, START_NS, YEARS)
    settled = _settled(life)
    fixed, later = _fixed(life, settled, _n_learning(life)), _later(life, settled)
    return later.years, [
        sum(
            threshold.raised(
                later.histories[bearing].ln_k[DIRECTIONS.index(direction)], later.is_settled, band
            ).size
            for (bearing, direction), threshold in fixed.items()
        )
        for band in BANDS.tolist()
    ]


def _fixed(
    life: UnitLife, settled: npt.NDArray[np.bool_], n: int
) -> dict[FilmDirection, FixedThreshold]:
    return {
        (bearing, direction): FixedThreshold.learned(history.ln_k[row, :n][settled[:n]])
        for bearing, history in life.readings.items()
        for row, direction in enumerate(DIRECTIONS)
    }


def _settled(life: UnitLife) -> npt.NDArray[np.bool_]:
    """When all bearings had."""
    operation = life.operation
    limits = OperatingLimits(operation.rated_speed_rpm, operation.rated_power_mw)
    columns = (operation.time_ns, operation.speed_rpm, operation.power_mw, limits)
    found = [operation_history(*columns, h.oil_temperature_c) for h in life.readings.values()]
    return np.logical_and.reduce([one.is_settled for one in found])


def _n_learning(life: UnitLife) -> int:
    return int(np.searchsorted(life.operation.time_ns, START_NS + LEARNING_DAYS * DAY_NS))


def _later(life: UnitLife, settled: npt.NDArray[np.bool_]) -> Later:
    n = _n_learning(life)
    return Later(_rows(life, n), settled[n:])


def _rows(life: UnitLife, first: int) -> dict[str, StiffnessHistory]:
    return {bearing: one.rows(first, len(one)) for bearing, one in life.readings.items()}


def _origin(seed: int, bearing: str) -> Origin:
    return Origin(f"U{seed}", bearing, "ratio_order1", 1, "benchmark", START_NS)
