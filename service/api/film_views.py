"""A film now, in the words of the API."""

import math
from dataclasses import dataclass
from typing import cast

from core.baseline.baseline import BearingBaseline, QuantityBaseline
from core.baseline.history import DIRECTIONS
from core.change.decision import Decision, Verdict
from core.change.film_judge import FilmFinding, FilmNews
from core.change.film_reading import FilmReading
from core.change.settings import FilmRules
from service.api.context import Context
from service.api.film_conditions import condition_model
from service.api.film_models import (
    FilmBriefModel,
    FilmCauseModel,
    FilmChangeModel,
    FilmConditionModel,
    FilmDeviationModel,
    FilmDirectionModel,
    FilmLimitsModel,
    FilmModel,
    FilmWordModel,
    LevelHeldName,
    VerdictName,
)
from service.live.live_view import CurrentBearing
from service.runtime.times import rfc3339

CURRENT_PERIODS = 2.5
"""A reading older than so many periods, by the newest result, is no longer current."""

NORMAL_95 = 1.96
"""Half-width of the interval that holds 95 % of a normal distribution, over its deviation."""

NONE_IN_FORCE = "none_in_force"
NOT_LEARNED, NOT_TURNED_SO = "condition_not_learned", "attitude_not_learned"


@dataclass(frozen=True)
class SeenFilm:
    """What is known of a watched film.

    Parameters
    ----------
    news
        The newest reading with what was said of it.
    why_not_current
        Why that does not tell of now; None if it does.
    """

    rules: FilmRules
    current: CurrentBearing
    news: FilmNews | None
    baseline: BearingBaseline | None
    why_not_current: str | None


def why_unwatched(context: Context, unit: str, bearing: str) -> str | None:
    """Why a film is not watched; None if it is."""
    if unit in context.films.unwatched:
        return context.films.unwatched[unit]
    is_watched = context.films.place(unit, bearing) is not None
    return None if is_watched else "conditions need the oil_temperature of the bearing"


def film_model(context: Context, unit: str, bearing: str) -> FilmModel:
    """The film of a bearing now."""
    seen, place = _seen(context, unit, bearing), context.films.place(unit, bearing)
    x, y = _directions(seen) if seen else (None, None)
    limits = seen.rules.change if seen else None
    return FilmModel(
        unit=unit,
        bearing=bearing,
        is_watched=seen is not None,
        why_not=why_unwatched(context, unit, bearing),
        estimator=place.estimator.value if place else None,
        time=rfc3339(seen.news.reading.time_ns) if seen and seen.news else None,
        is_current=seen is not None and seen.why_not_current is None,
        next_reading=_next_reading(seen) if seen else None,
        condition=_condition(seen) if seen else None,
        baseline_version=_version(seen.baseline) if seen else None,
        limits=FilmLimitsModel(alert=limits.alert_change, danger=limits.danger_change)
        if limits
        else None,
        x=x,
        y=y,
    )


def film_brief(context: Context, unit: str, bearing: str) -> FilmBriefModel:
    """The film of a bearing at a glance."""
    seen = _seen(context, unit, bearing)
    x, y = (_word(found) for found in _directions(seen)) if seen else (None, None)
    return FilmBriefModel(bearing=bearing, why_not=why_unwatched(context, unit, bearing), x=x, y=y)


def _word(found: FilmDirectionModel) -> FilmWordModel:
    percent = found.change.percent if found.change else None
    return FilmWordModel(verdict=found.verdict, level=found.level, change_percent=percent)


def _seen(context: Context, unit: str, bearing: str) -> SeenFilm | None:
    rules = context.films.rules(unit)
    if rules is None or context.films.place(unit, bearing) is None:
        return None
    baseline = context.films.baseline(unit, bearing)
    news, current = context.films.newest(unit, bearing), context.live.current(unit, bearing)
    why = _why_not_current(news, current, rules, _version(baseline))
    return SeenFilm(rules, current, news, baseline, why)


def _version(baseline: BearingBaseline | None) -> int | None:
    return baseline.origin.version if baseline else None


def _why_not_current(
    news: FilmNews | None, current: CurrentBearing, rules: FilmRules, version: int | None
) -> str | None:
    if current.assessment is None or not current.is_current:
        return current.quality.reason.value
    if news is None:
        return "waiting_for_data"
    if current.assessment.time_ns - news.reading.time_ns > CURRENT_PERIODS * rules.reading_ns:
        return "stale"
    return None if news.findings[0].baseline_version == version else "baseline_changed"


def _next_reading(seen: SeenFilm) -> str | None:
    """When the next slot begins after the newest result."""
    newest, period_ns = seen.current.assessment, seen.rules.reading_ns
    if newest is None or not seen.current.is_current:
        return None
    return rfc3339((newest.time_ns // period_ns + 1) * period_ns)


def _condition(seen: SeenFilm) -> FilmConditionModel | None:
    newest = seen.current.assessment
    if newest is None or newest.condition is None or not seen.current.is_current:
        return None
    return condition_model(newest.time_ns, newest.condition, seen.rules.grid)


def _directions(seen: SeenFilm) -> tuple[FilmDirectionModel, FilmDirectionModel]:
    if seen.news is None or seen.why_not_current is not None:
        levels = [f.level for f in seen.news.findings] if seen.news else [None, None]
        x, y = (_unread(seen.why_not_current or "", level_name(level)) for level in levels)
        return x, y
    x, y = (_direction(seen, seen.news, row) for row in range(len(DIRECTIONS)))
    return x, y


def _unread(reason: str, level: LevelHeldName | None) -> FilmDirectionModel:
    """Without a current reading nothing is said but what is held."""
    return FilmDirectionModel(
        verdict="no_reading",
        reason=reason,
        level=level,
        change=None,
        deviation=None,
        stiffness_n_per_m=None,
        cause=None,
    )


def _direction(seen: SeenFilm, news: FilmNews, row: int) -> FilmDirectionModel:
    finding, ln_k = news.findings[row], news.reading.values[row].ln_k
    attribution = finding.attribution
    return FilmDirectionModel(
        verdict=verdict_name(finding.verdict),
        reason=_reason(seen, news.reading, finding, row),
        level=level_name(finding.level),
        change=_change(finding, news.decisions[row], seen.rules),
        deviation=_deviation(finding),
        stiffness_n_per_m=None if math.isnan(ln_k) else math.exp(ln_k),
        cause=FilmCauseModel(
            cause=attribution.cause.value,
            reason=attribution.reason,
            film_share=attribution.film_share,
            film_share_std=attribution.film_share_std,
        )
        if attribution
        else None,
    )


def _reason(seen: SeenFilm, reading: FilmReading, finding: FilmFinding, row: int) -> str:
    match finding.verdict:
        case Verdict.NO_BASELINE:
            learned = seen.baseline.of(DIRECTIONS[row]) if seen.baseline else None
            return NONE_IN_FORCE if learned is None else _unseen(learned, reading)
        case Verdict.TRANSIENT:
            return "not_settled"
        case _:
            return reading.values[row].reason.value


def _unseen(learned: QuantityBaseline, reading: FilmReading) -> str:
    """What about a condition has not been learned: its cell, or only where the shaft lies in it."""
    is_seen = learned.table.find(learned.grid.cells(reading.conditions))[0] >= 0
    return NOT_TURNED_SO if is_seen else NOT_LEARNED


def _change(finding: FilmFinding, decision: Decision, rules: FilmRules) -> FilmChangeModel | None:
    change, std, time_scale_h = finding.change, finding.change_std, finding.time_scale_h
    if change is None or std is None or time_scale_h is None:
        return None
    low, high = interval_percent(change, std)
    counted_ns = decision.last_counted_ns
    return FilmChangeModel(
        percent=percent_of(change),
        low_95=low,
        high_95=high,
        ln=change,
        ln_std=std,
        time_scale_h=time_scale_h,
        significance=abs(change) / std,
        significance_wanted=rules.change.significance_threshold(time_scale_h),
        as_of=None if counted_ns is None else rfc3339(round(counted_ns / rules.time_lapse)),
    )


def _deviation(finding: FilmFinding) -> FilmDeviationModel | None:
    if finding.deviation is None or finding.deviation_std is None:
        return None
    low, high = interval_percent(finding.deviation, finding.deviation_std)
    return FilmDeviationModel(percent=percent_of(finding.deviation), low_95=low, high_95=high)


def percent_of(ln: float) -> float:
    """Relative change, %, of what has changed by so much in ln."""
    return 100.0 * math.expm1(ln)


def interval_percent(ln: float, std: float) -> tuple[float, float]:
    """Its 95 % interval, %."""
    return percent_of(ln - NORMAL_95 * std), percent_of(ln + NORMAL_95 * std)


def verdict_name(verdict: Verdict) -> VerdictName:
    """A verdict in the word of the API."""
    return cast("VerdictName", verdict.name.lower())


def level_name(level: int | None) -> LevelHeldName | None:
    """A level in the word of the API."""
    return None if level is None else cast("LevelHeldName", Verdict(int(level)).name.lower())
