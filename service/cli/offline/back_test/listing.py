"""A back-test's report for people."""

from collections.abc import Iterator, Sequence

from service.cli.offline.back_test.report import (
    AlarmReport,
    BackTestReport,
    ChangeReport,
    FilmReport,
)

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
    """All of it."""
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
            said = f"  {_name(film):<22}{found.learned_from} to {found.learned_until}{event}: "
            if not found.is_learned:
                yield said + "too few readings to learn from"
                continue
            yield said + (
                f"{found.cells_own} cells of its own, {found.cells_borrowed} borrowed,"
                f" {found.cells_without_support} without support,"
                f" scatter {found.scatter_percent:.2f} %, {found.rejected_percent:.1f} % rejected"
            )


def _alarm_lines(alarm: AlarmReport) -> Iterator[str]:
    name = f"{alarm.unit} {alarm.bearing} {alarm.direction}"
    yield f"  {alarm.begin} to {alarm.end or 'the last reading':<24} {name}, {alarm.level}"
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


def _name(film: FilmReport) -> str:
    return f"{film.unit} {film.bearing} {film.direction}"
