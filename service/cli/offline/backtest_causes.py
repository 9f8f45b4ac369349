"""Causes of the alarms of one unit, from the motion of its shaft in all bearings."""

from collections.abc import Sequence
from functools import cached_property, reduce

import numpy as np

from core.arrays import FloatArray, TimeArray
from core.baseline.history import DIRECTIONS
from core.change.cause import Attribution, Cause, UnitReadings, attribute
from core.change.shaft_response import MEAN_READINGS, ShaftResponse, film_columns, learn_response
from service.cli.offline.backtest_bearing import BackTestRules, BearingRun, Period, periods_of

NO_AMPLITUDES = Attribution(Cause.UNKNOWN, "readings of at least one bearing have no shaft_um_pk")
NOT_LEARNED = Attribution(Cause.UNKNOWN, "the response of the shaft has not been learned")


class UnitCauses:
    """Causes of the alarms of one unit, from its shaft response in each period.

    Parameters
    ----------
    runs
        Back-tests of all bearings of the unit. Only times at which all have a reading are used.

    Attributes
    ----------
    responses
        Shaft response of each period; None if it could not be learned.
    """

    def __init__(self, unit: str, runs: Sequence[BearingRun], rules: BackTestRules) -> None:
        self._runs, self._rules = runs, rules
        times = [run.rows.history.time_ns for run in runs]
        self._time_ns: TimeArray = reduce(np.intersect1d, times)
        self._rows = [np.isin(time_ns, self._time_ns) for time_ns in times]
        self._histories = {
            run.place[1]: run.rows.history.where(rows)
            for run, rows in zip(runs, self._rows, strict=True)
        }
        self._has_amplitudes = all(
            np.isfinite(history.shaft_um_pk).any() for history in self._histories.values()
        )
        events = [event for event in rules.events if event.unit == unit]
        self._periods = periods_of(self._time_ns, events, rules.learning)
        self.responses = [self._learned(period) for period in self._periods]

    def of(self, bearing: str, direction: str, time_ns: int) -> Attribution:
        """Return the cause of a film alarm, found from the readings up to `time_ns`.

        `time_ns` is in ns since 1970 UTC. The cause is unknown if the readings have no shaft
        amplitudes, or if the time is in the period from which the baseline is learned.
        """
        if not self._has_amplitudes:
            return NO_AMPLITUDES
        last = int(np.searchsorted(self._time_ns, time_ns, side="right"))
        number = next((n for n, p in enumerate(self._periods) if p.begin < last <= p.end), None)
        response = None if number is None else self.responses[number]
        if response is None or number is None:
            return NOT_LEARNED
        first = self._periods[number].learned
        place, rows = (bearing, direction), np.arange(first, last)
        known = np.isfinite(self._readings.deviation[response.places.index(place), first:last])
        newest = self._readings.columns(rows[known][-MEAN_READINGS:])
        known_n_per_m = [self._rules.bracket_n_per_m.get(run.place) for run in self._runs]
        brackets = None
        if all(known_n_per_m):
            brackets = np.repeat(np.array(known_n_per_m, np.float64), len(DIRECTIONS))
        return attribute(place, response, newest, brackets)

    def _learned(self, period: Period) -> ShaftResponse | None:
        if not self._has_amplitudes or period.learned == period.begin:
            return None
        pairs = zip(self._runs, self._rows, strict=True)
        settled = np.logical_and.reduce([run.operation.is_settled[rows] for run, rows in pairs])
        return learn_response(
            {b: h.rows(period.begin, period.learned) for b, h in self._histories.items()},
            settled[period.begin : period.learned],
        )

    @cached_property
    def _readings(self) -> UnitReadings:
        compared = [
            [column[rows] for column in _compared_places(run, direction)]
            for run, rows in zip(self._runs, self._rows, strict=True)
            for direction in DIRECTIONS
        ]
        deviation, rise = (np.stack(columns) for columns in zip(*compared, strict=True))
        attitude = [h.attitude_deg for h in self._histories.values() for _ in DIRECTIONS]
        columns = (*film_columns(self._histories), deviation, rise, np.stack(attitude))
        return UnitReadings(*columns)


def _compared_places(run: BearingRun, direction: str) -> tuple[FloatArray, FloatArray]:
    """Return the (n,) deviation of settled readings, and the rise of the eccentricity ratio."""
    deviation, rise = np.full((2, len(run.rows.history)), np.nan)
    for period in run.periods:
        baseline = period.stiffness(direction)
        if baseline is None:
            continue
        rows = slice(period.period.learned, period.period.end)
        history = run.rows.history.rows(rows.start, rows.stop)
        deviation[rows] = baseline.compare_history(history).deviation
        rise[rows] = baseline.eccentricity_rise(history.conditions)
    return np.where(run.operation.is_settled, deviation, np.nan), rise
