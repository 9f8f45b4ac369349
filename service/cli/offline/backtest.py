"""Back-test of all units of a file: run, print and export."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from itertools import groupby
from pathlib import Path

import numpy as np

from core.baseline.baseline import BearingBaseline
from core.baseline.history import ReadingOutcome
from core.change.shaft_response import ShaftResponse
from core.condition.operating_state import STEADY
from core.units import DAY_NS
from service.cli.offline.backtest_bearing import (
    BackTestRules,
    BearingRun,
    MachineEvent,
    run_bearing,
)
from service.cli.offline.backtest_causes import UnitCauses
from service.cli.offline.backtest_cells import ReadingsError
from service.cli.offline.backtest_files import IDENTIFIER
from service.cli.offline.backtest_histories import BearingRows, Place
from service.cli.offline.backtest_report import (
    AlarmReport,
    BackTestReport,
    ChangeReport,
    FilmReport,
    RateReport,
    alarm_reports,
    film_reports,
)
from service.runtime.times import EPOCH
from service.store.documents import to_json

YEAR_NS = 365.25 * DAY_NS
MAX_PERIOD_RATIO = 2.0
"""Ratio of a reading's nominal period to the time between readings that raises a warning."""

MIN_RATE_YEARS = 1.0 / 12.0
"""Shortest time of compared readings, in unit-years, for which a rate of alarms is reported: one
alarm in a shorter time could mean any rate up to hundreds per year."""


@dataclass
class BackTestResult:
    """Films, alarms, baselines, shaft responses and warnings that a back-test has found.

    `responses` are triples of unit id, number of the period (from 1) and shaft response;
    `unit_years` is the time after learning in years, summed over the units.
    """

    films: list[FilmReport] = field(default_factory=list)
    alarms: list[AlarmReport] = field(default_factory=list)
    baselines: list[BearingBaseline] = field(default_factory=list)
    responses: list[tuple[str, int, ShaftResponse]] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)
    unit_years: float = 0.0

    def report(self, file: str, n_rows: int, duration_s: float) -> BackTestReport:
        """Return the report; the back-test of `n_rows` rows of `file` took `duration_s` seconds."""
        n_alarms, n_danger = len(self.alarms), sum(a.level == "danger" for a in self.alarms)
        per_year = n_alarms / self.unit_years if self.unit_years >= MIN_RATE_YEARS else None
        return BackTestReport(
            file=file,
            rows=n_rows,
            films=self.films,
            alarms=self.alarms,
            rate=RateReport(
                unit_years=self.unit_years,
                n_alarms=n_alarms,
                n_danger=n_danger,
                alarms_per_unit_year=per_year,
            ),
            doubts=self.doubts,
            duration_s=duration_s,
            readings_per_s=n_rows / max(duration_s, 1e-9),
        )


def run_back_test(
    histories: Mapping[Place, BearingRows],
    rules: BackTestRules,
    advanced: Callable[[int], object] = lambda _: None,
) -> BackTestResult:
    """Learn the baselines of all bearings, and compare the later readings with the baselines.

    Parameters
    ----------
    advanced
        Called with the number of rows processed since the last call.

    Raises
    ------
    ReadingsError
        If a machine event names a bearing without readings, or operating states are unknown.
    """
    result = BackTestResult(doubts=list(_doubts(histories, rules)))
    for event in rules.events:
        if not any(event.is_about(*place) for place in histories):
            name = event.unit + (f"/{event.bearing}" if event.bearing else "")
            raise ReadingsError(
                f"event of {name}: the file has no readings of {name}; correct the event"
            )
    for unit, places in groupby(sorted(histories), key=lambda place: place[0]):
        runs = []
        for place in places:
            runs.append(run_bearing(place, histories[place], rules))
            advanced(sum(histories[place].n_rows))
        _add_unit(result, unit, runs, rules)
    result.alarms.sort(key=lambda a: (a.begin, a.unit, a.bearing, a.direction))
    return result


def _add_unit(
    result: BackTestResult, unit: str, runs: Sequence[BearingRun], rules: BackTestRules
) -> None:
    causes = UnitCauses(unit, runs, rules)
    result.alarms += alarm_reports(runs, causes)
    for run in runs:
        result.films += film_reports(run)
        result.baselines += [p.baseline for p in run.periods if p.baseline is not None]
        result.doubts += _doubts_of(run)
    result.responses += [
        (unit, number, response)
        for number, response in enumerate(causes.responses, start=1)
        if response is not None
    ]
    result.unit_years += max(_compared_ns(run) for run in runs) / YEAR_NS


def _doubts_of(run: BearingRun) -> Iterator[str]:
    """Yield the reasons to doubt the baselines of a bearing, such as cold oil throughout."""
    place = " ".join(run.place)
    for p in run.periods:
        if p.doubt:
            drift = f"{p.doubt}; the service would require acceptance by an engineer"
            yield f"{place} baseline {p.period.version}: {drift}"
    for p in run.periods:
        if p.far:
            yield f"{place} baseline {p.period.version}: {p.far}"
    n = int(np.isin(run.operation.state, [int(state) for state in STEADY]).sum())
    if n and not run.operation.is_settled.any():
        yield (
            f"{place}: none of {n} readings at speed was settled, so nothing was learned or"
            " judged: each run ends before the oil temperature has settled"
        )


def _compared_ns(run: BearingRun) -> int:
    """Return the time from the end of learning to the last reading, summed over periods."""
    time_ns = run.rows.history.time_ns
    return sum(
        int(time_ns[p.period.end - 1] - time_ns[p.period.learned])
        for p in run.periods
        if p.period.learned < p.period.end
    )


def _doubts(histories: Mapping[Place, BearingRows], rules: BackTestRules) -> Iterator[str]:
    nominal_h = rules.baseline.reading_h
    for (unit, bearing), rows in histories.items():
        history = rows.history
        if len(history) > 1:
            apart_h = float(np.median(np.diff(history.time_ns))) / 3.6e12
            ratio = apart_h / nominal_h
            if not 1.0 / MAX_PERIOD_RATIO <= ratio <= MAX_PERIOD_RATIO:
                yield (
                    f"{unit} {bearing}: readings are {60 * apart_h:.3g} min apart, but each counts"
                    f" as {60 * nominal_h:.3g} min; set reading_period_s"
                )
        is_good = np.any(history.outcome == ReadingOutcome.MEASURED, axis=0)
        is_known = np.isfinite(history.eccentricity_ratio) & np.isfinite(history.oil_temperature_c)
        if n := int(np.sum(is_good & ~is_known)):
            yield (
                f"{unit} {bearing}: {n} of {len(history)} readings have a good stiffness but no"
                " eccentricity_ratio or no oil_temperature_c; they were neither learned nor judged"
            )
        if rules.baseline.uses_attitude and not np.isfinite(history.attitude_deg).any():
            yield f"{unit} {bearing}: no attitude_deg, so its baseline does not use it"


def export_baselines(result: BackTestResult, folder: Path) -> int:
    """Write all baselines and shaft responses into a new folder; return the number of files.

    Raises
    ------
    OSError
        If the folder exists, or cannot be written.
    """
    folder.mkdir(parents=True)
    documents: dict[str, BearingBaseline | ShaftResponse] = {
        f"{b.origin.unit}-{b.origin.bearing}-v{b.origin.version}.json": b for b in result.baselines
    }
    for unit, number, response in result.responses:
        documents[f"{unit}-shaft-response-v{number}.json"] = response
    for name, document in documents.items():
        (folder / name).write_text(to_json(document), encoding="utf-8")
    return len(documents)


VERDICTS = {
    "normal": "normal",
    "alert": "alert",
    "danger": "danger",
    "gathering_evidence": "gathering",
    "no_baseline": "no_basel.",
    "insufficient_excitation": "no_excit.",
    "bad_quality": "bad_qual.",
    "transient": "transient",
}


def lines_of(report: BackTestReport) -> Iterator[str]:
    """Yield a report in lines of text: doubts, readings by verdict, baselines, alarms, rates."""
    yield f"{report.file}: {report.rows} rows"
    yield from (f"  doubtful: {doubt}" for doubt in report.doubts)
    yield "\nReadings by verdict"
    yield from _film_lines(report.films)
    yield "\nBaselines"
    yield from _baseline_lines(report.films)
    yield f"\nAlarms: {len(report.alarms)}"
    for alarm in report.alarms:
        yield from _alarm_lines(alarm)
    rate = report.rate
    per_year = "—" if rate.alarms_per_unit_year is None else f"{rate.alarms_per_unit_year:.3f}"
    yield (
        f"\n{rate.n_alarms} alarms ({rate.n_danger} of danger) in {rate.unit_years:.2f} unit-years"
        f" after learning: {per_year} per unit-year"
    )
    yield f"{report.readings_per_s:.0f} readings/s, {report.duration_s:.1f} s"


def _film_lines(films: Sequence[FilmReport]) -> Iterator[str]:
    heads = "".join(f"{word:>10}" for word in VERDICTS.values())
    yield f"  {'film':<22}{'learning':>9}{heads}{'judged':>9}{'alarms':>8}"
    for film in films:
        counts = "".join(f"{film.verdicts[key]:>10}" for key in VERDICTS)
        judged = "—" if film.judged_percent is None else f"{film.judged_percent:.1f} %"
        yield f"  {_name(film):<22}{film.learning:>9}{counts}{judged:>9}{film.n_alarms:>8}"


def _baseline_lines(films: Sequence[FilmReport]) -> Iterator[str]:
    for film in films:
        for found in film.baselines:
            event = f" after {found.event!r}" if found.event else ""
            period = f"  {_name(film):<22}{found.learned_from} to {found.learned_until}{event}: "
            if not found.is_learned:
                yield period + "too few readings to learn from"
                continue
            yield period + (
                f"{found.cells_own} cells of its own, {found.cells_borrowed} borrowed,"
                f" {found.cells_without_support} without support,"
                f" scatter {found.scatter_percent:.2f} %, {found.rejected_percent:.1f} % rejected"
            )


def _alarm_lines(alarm: AlarmReport) -> Iterator[str]:
    end = alarm.end or "the last reading"
    yield f"  {alarm.begin} to {end:<24} {_name(alarm)}, {alarm.level}"
    danger = f", danger from {alarm.danger}" if alarm.danger else ""
    yield f"    {_change(alarm.raised)}, at most {_change(alarm.largest)}{danger}"
    found = alarm.condition
    yield (
        f"    {found.state}, eccentricity {_number(found.eccentricity_ratio, '.3f')},"
        f" oil {_number(found.oil_temperature_c, '.1f')} °C"
    )
    yield f"    cause: {alarm.cause.cause} ({alarm.cause.reason})"
    if alarm.later_cause.cause != alarm.cause.cause:
        yield f"    a day later: {alarm.later_cause.cause} ({alarm.later_cause.reason})"


def _change(found: ChangeReport) -> str:
    return f"{found.percent:+.1f} ± {found.u_percent:.1f} % over {found.time_scale_h:g} h"


def _number(value: float | None, form: str) -> str:
    return "—" if value is None else format(value, form)


def _name(of: FilmReport | AlarmReport) -> str:
    return f"{of.unit} {of.bearing} {of.direction}"


_EVENT = re.compile(
    r"(?P<unit>[^\s/]+)(?:/(?P<bearing>[^\s/]+))?\s+(?P<time>\S+)(?:\s+(?P<text>.*))?"
)
MAX_TEXT = 200


def time_ns_of(text: str) -> int:
    """Return an ISO 8601 time with an offset as ns since 1970 UTC, truncated to microseconds.

    Raises
    ------
    ValueError
        If the text is not ISO 8601 or has no offset from UTC.
    """
    try:
        moment = datetime.fromisoformat(text)
    except ValueError as error:
        raise ValueError(f"{text!r:.60} is not a time such as 2026-03-01T08:00:00Z") from error
    if moment.tzinfo is None:
        raise ValueError(f"{text!r:.60} requires an offset from UTC, such as a trailing Z")
    return (moment - EPOCH) // timedelta(microseconds=1) * 1000


def event_of(text: str) -> MachineEvent:
    """Return the machine event in a text of the form ``UNIT[/BEARING] TIME [TEXT]``.

    ``TEXT`` is "machine event" by default, and is cut to `MAX_TEXT` characters.

    Raises
    ------
    ValueError
        If the text has another form, or its time has another form or no offset from UTC.
    """
    found = _EVENT.fullmatch(text.strip())
    names = [found["unit"], found["bearing"]] if found else []
    if not found or not all(name is None or IDENTIFIER.fullmatch(name) for name in names):
        example = "'U1 2026-03-01T08:00:00Z overhaul' or 'U1/UJB 2026-03-01T08:00:00Z new pads'"
        raise ValueError(f"{text!r:.60} is not an event such as {example}")
    text = (found["text"] or "machine event")[:MAX_TEXT]
    return MachineEvent(found["unit"], found["bearing"], time_ns_of(found["time"]), text)
