"""All units of a file, one after the other, into one report and the baselines that were learned."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby

import numpy as np

from core.baseline.baseline import BearingBaseline
from core.baseline.history import ReadingOutcome, StiffnessHistory
from core.change.shaft_response import ShaftResponse
from core.condition.operating_state import STEADY
from core.units import DAY_NS
from service.cli.offline.back_test.bearing_run import BackTestRules, BearingRun, run_bearing
from service.cli.offline.back_test.causes import UnitCauses
from service.cli.offline.back_test.file_columns import ReadingsError
from service.cli.offline.back_test.histories import BearingRows, Place
from service.cli.offline.back_test.report import AlarmReport, FilmReport, RateReport
from service.cli.offline.back_test.unit_report import alarm_reports, film_reports

YEAR_NS = 365.25 * DAY_NS
APART = 2.0
"""How many times a reading's length may be off the time between readings without a doubt."""


@dataclass
class Found:
    """What has been found so far."""

    films: list[FilmReport] = field(default_factory=list)
    alarms: list[AlarmReport] = field(default_factory=list)
    baselines: list[BearingBaseline] = field(default_factory=list)
    responses: list[tuple[str, int, ShaftResponse]] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)
    unit_years: float = 0.0

    def rate(self) -> RateReport:
        """How often it alarmed."""
        n_alarms = len(self.alarms)
        return RateReport(
            unit_years=self.unit_years,
            n_alarms=n_alarms,
            n_danger=sum(alarm.level == "danger" for alarm in self.alarms),
            alarms_per_unit_year=n_alarms / self.unit_years if self.unit_years else None,
        )


def run_back_test(
    histories: Mapping[Place, BearingRows],
    rules: BackTestRules,
    advanced: Callable[[int], object] = lambda _: None,
) -> Found:
    """Learn and decide over everything.

    Parameters
    ----------
    advanced
        Told how many more rows have been dealt with.

    Raises
    ------
    ReadingsError
        If an event is about a bearing without readings, or operating states are not known.
    """
    found = Found(doubts=list(_doubts(histories, rules)))
    _check_events(histories, rules)
    for unit, places in groupby(sorted(histories), key=lambda place: place[0]):
        runs = []
        for place in places:
            runs.append(run_bearing(place, histories[place], rules))
            advanced(sum(histories[place].n_rows))
        _take_unit(found, unit, runs, rules)
    found.alarms.sort(key=lambda a: (a.begin, a.unit, a.bearing, a.direction))
    return found


def _take_unit(found: Found, unit: str, runs: Sequence[BearingRun], rules: BackTestRules) -> None:
    causes = UnitCauses(unit, runs, rules)
    found.alarms += alarm_reports(runs, causes)
    for run in runs:
        found.films += film_reports(run)
        found.baselines += [p.baseline for p in run.periods if p.baseline is not None]
        found.doubts += [
            f"{' '.join(run.place)} baseline {p.period.version}: {p.doubt}; the service would leave"
            " it to an engineer"
            for p in run.periods
            if p.doubt
        ]
        found.doubts += [
            f"{' '.join(run.place)} baseline {p.period.version}: {p.far}"
            for p in run.periods
            if p.far
        ]
        found.doubts += _unsettled(run)
    found.responses += [
        (unit, number, response)
        for number, response in enumerate(causes.responses, start=1)
        if response is not None
    ]
    found.unit_years += max(_compared_ns(run) for run in runs) / YEAR_NS


def _unsettled(run: BearingRun) -> Iterator[str]:
    """Why nothing was learned or judged, if the bearing was never warm."""
    n = int(np.isin(run.operation.state, [int(state) for state in STEADY]).sum())
    if n and not run.operation.is_settled.any():
        yield (
            f"{' '.join(run.place)}: none of {n} readings at speed was settled, so that nothing was"
            " learned or judged: each run ends before the oil temperature has settled"
        )


def _compared_ns(run: BearingRun) -> int:
    """Time from the end of learning to the last reading, all periods together."""
    time_ns = run.rows.history.time_ns
    return sum(
        int(time_ns[p.period.end - 1] - time_ns[p.period.learned])
        for p in run.periods
        if p.period.learned < p.period.end
    )


def _check_events(histories: Mapping[Place, BearingRows], rules: BackTestRules) -> None:
    for event in rules.events:
        if not any(event.is_about(*place) for place in histories):
            name = event.unit + (f"/{event.bearing}" if event.bearing else "")
            raise ReadingsError(f"event of {name}: there are no readings of it")


def _doubts(histories: Mapping[Place, BearingRows], rules: BackTestRules) -> Iterator[str]:
    """What makes a result worth less than it looks."""
    told_h = rules.baseline.reading_h
    for (unit, bearing), rows in histories.items():
        history = rows.history
        if len(history) > 1:
            apart_h = float(np.median(np.diff(history.time_ns))) / 3.6e12
            if not told_h / APART <= apart_h <= told_h * APART:
                yield (
                    f"{unit} {bearing}: readings are {60 * apart_h:.3g} min apart and are taken to"
                    f" stand for {60 * told_h:.3g} min each; set reading_period_s"
                )
        if n := _without_condition(history):
            yield (
                f"{unit} {bearing}: {n} of {len(history)} readings have a good stiffness but no"
                " eccentricity_ratio or no oil_temperature_c; they were neither learned nor judged"
            )
        if rules.baseline.uses_attitude and not np.isfinite(history.attitude_deg).any():
            yield f"{unit} {bearing}: no attitude_deg, so that its baseline does without"


def _without_condition(history: StiffnessHistory) -> int:
    is_good = np.any(history.outcome == ReadingOutcome.MEASURED, axis=0)
    is_known = np.isfinite(history.eccentricity_ratio) & np.isfinite(history.oil_temperature_c)
    return int(np.sum(is_good & ~is_known))
