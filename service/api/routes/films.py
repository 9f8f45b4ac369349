"""Route for the current state of an oil film: verdict, change of stiffness, cause, condition."""

import math
from dataclasses import dataclass
from functools import partial
from itertools import chain
from typing import Annotated, Any, Literal, cast

from fastapi import APIRouter, Request, Response
from pydantic import Field

from core.baseline.baseline import BearingBaseline, QuantityBaseline
from core.baseline.history import DIRECTIONS, QUANTITIES, are_ratios
from core.change.decision import Decision, Verdict
from core.change.film_judge import FilmFinding, FilmNews
from core.change.film_reading import FilmReading
from core.change.settings import ChangeLimits, FilmRules, percent_of
from service.api.auth.declared import subject_router
from service.api.context import BearingId, Context, UnitId
from service.api.problems import ProblemError, problem_responses
from service.api.values import (
    ApiModel,
    BearingAnswer,
    ByName,
    EstimatorName,
    FilmConditionModel,
    Time,
    condition_model,
)
from service.live.commands import FilmPlace
from service.live.status import CurrentBearing

VerdictName = Literal[
    "normal",
    "alert",
    "danger",
    "gathering_evidence",
    "no_baseline",
    "insufficient_excitation",
    "bad_quality",
    "transient",
    "no_reading",
]

CauseName = Literal["film", "oil", "bracket_or_transducer", "unknown"]


LevelHeldName = Literal["alert", "danger"]


class FilmChangeModel(ApiModel):
    """Mean deviation from the baseline, at its most significant averaging time."""

    percent: Annotated[float, Field(examples=[-19.2])]
    """Mean change, % of the expected value; negative if softer. The alarm limits apply to it.
    After a sudden change, it follows the deviation of the newest reading with delay."""

    time_scale_h: Annotated[float, Field(examples=[4.0])]
    """Averaging time of this change, running hours."""

    significance: Annotated[float, Field(examples=[12.4])]
    """Absolute value of the change, divided by its standard uncertainty."""

    significance_wanted: Annotated[float, Field(examples=[6.5])]
    """Smallest significance at which a change with this averaging time can raise an alarm."""

    as_of: Time | None
    """Time of the newest reading in the average; null if this reading was made before the service
    started or before the baseline in force."""


class FilmDeviationModel(ApiModel):
    """Deviation of one reading from the baseline."""

    percent: float
    """Deviation, % of the expected stiffness."""

    low_95: float
    """Lower end of the 95 % interval of the deviation, %."""

    high_95: float
    """Upper end of the 95 % interval of the deviation, %."""


class FilmCauseModel(ApiModel):
    """Cause of a change of stiffness, inferred from the motion of shaft and bearing."""

    cause: CauseName
    """Cause: film of this bearing, oil of all bearings, bracket or transducer, or unknown."""

    reason: str
    """Reason why this cause was inferred."""

    film_share: float | None
    """Fraction of the change that is due to the film if a transducer error causes the rest, 0 to 1
    within its uncertainty; null if unknown, or if no such combination explains the motion."""

    film_share_std: float | None
    """Standard uncertainty of `film_share`; null if `film_share` is null."""


class FilmQuantityModel(ApiModel):
    """Decision on a quantity of an oil film in one direction, x or y."""

    verdict: Annotated[VerdictName, ByName]
    """Verdict on the newest reading. Only "normal", "alert" and "danger" judge the film. The other
    verdicts state why it is not judged: too little evidence yet ("gathering_evidence"), no baseline
    for this condition ("no_baseline"), too little motion ("insufficient_excitation"), a doubtful
    value ("bad_quality"), a unit that has not settled ("transient"), or no current reading
    ("no_reading")."""

    reason: Annotated[str, Field(examples=["condition_not_learned"])]
    """Reason why the film is not judged; "ok" if it is judged."""

    level: LevelHeldName | None
    """Alarm level in force, also while the newest reading cannot be judged; null if none."""

    change: FilmChangeModel | None
    """Change against the baseline; null without a baseline, until the shortest averaging time has
    passed, and without a current reading."""

    deviation: FilmDeviationModel | None
    """Deviation of the newest reading alone; null if this reading was not compared."""

    cause: FilmCauseModel | None
    """Cause of the change while a level is in force; otherwise null."""


class FilmDampingModel(FilmQuantityModel):
    """Decision on damping over stiffness, c/k."""

    ck_s: float | None
    """Damping over stiffness of the newest reading, s; null if it could not be determined."""

    expected_s: float | None
    """Damping over stiffness that the baseline expects, s; null if it was not compared."""


class FilmDirectionModel(FilmQuantityModel):
    """State of an oil film in one direction, x or y: stiffness, and damping over stiffness."""

    stiffness_n_per_m: float | None
    """Stiffness of the newest reading, N/m; null if it could not be determined."""

    expected_n_per_m: float | None
    """Stiffness that the baseline expects under the condition of the newest reading, N/m; null if
    this reading was not compared."""

    stiffness_of_kb: float | None
    """Stiffness as a ratio to the bracket stiffness; null if the latter is known."""

    expected_of_kb: float | None
    """Expected stiffness as such a ratio; null if the bracket stiffness is known."""

    damping: FilmDampingModel
    """Damping over stiffness, of the estimator "dynamic"."""


class FilmLimitsModel(ApiModel):
    """Alarm limits for a mean change, as increase and as decrease."""

    alert_percent: Annotated[float, Field(examples=[3.5])]
    """Limit for an alert, % of the expected value."""

    danger_percent: Annotated[float, Field(examples=[15.0])]
    """Limit for danger, % of the expected value."""


class FilmModel(BearingAnswer):
    """Current state of the oil film of a bearing."""

    is_watched: bool
    """Whether the film is watched: its stiffness is compared with a baseline."""

    why_not: str | None
    """Reason why the film is not watched; null if it is watched."""

    estimator: EstimatorName | None
    """Fixed estimator of the stiffness, so that readings are comparable; null if not watched."""

    time: Time | None
    """Time of the newest reading; null without a reading since the service started."""

    is_current: bool
    """Whether the newest reading is recent and the baseline in force has not changed since then."""

    next_reading: Time | None
    """Time at which the next reading is due; null without current data."""

    condition: FilmConditionModel | None
    """Operating condition of the bearing at the newest result; null without current data."""

    baseline_version: int | None
    """Version of the baseline in force; null if no baseline is in force."""

    limits: FilmLimitsModel | None
    """Alarm limits of the stiffness; null if the film is not watched."""

    damping_limits: FilmLimitsModel | None
    """Alarm limits of damping over stiffness; null if the film is not watched."""

    x: FilmDirectionModel | None
    """State in x; null if the film is not watched."""

    y: FilmDirectionModel | None
    """State in y; null if the film is not watched."""


class FilmWordModel(ApiModel):
    """Verdict, alarm level, stiffness and change of a film in one direction."""

    verdict: VerdictName
    """Verdict on the newest reading; "no_reading" if this reading is not current."""

    level: LevelHeldName | None
    """Alarm level in force; null without a level."""

    change_percent: float | None
    """Most significant mean change of stiffness, % of the expected stiffness; null if `change` of
    the film is null."""

    deviation_percent: float | None
    """Deviation of the newest reading alone, % of the expected stiffness; null if this reading was
    not compared."""

    ck_level: LevelHeldName | None
    """Alarm level of damping over stiffness in force; null without a level."""

    ck_change_percent: float | None
    """Most significant mean change of damping over stiffness, %; null if unknown."""

    stiffness_n_per_m: float | None
    """Stiffness of the newest reading, N/m; null if it could not be determined."""

    expected_n_per_m: float | None
    """Stiffness that the baseline expects, N/m; null if this reading was not compared."""

    stiffness_of_kb: float | None
    """Stiffness as a ratio to the bracket stiffness; null if the latter is known."""

    expected_of_kb: float | None
    """Expected stiffness as such a ratio; null if the bracket stiffness is known."""


class FilmBriefModel(ApiModel):
    """Summary of the oil film of a bearing."""

    why_not: str | None
    """Reason why the film is not watched; null if it is watched."""

    limits: FilmLimitsModel | None
    """Alarm limits; null if the film is not watched."""

    x: FilmWordModel | None
    """State in x; null if the film is not watched."""

    y: FilmWordModel | None
    """State in y; null if the film is not watched."""


CURRENT_PERIODS = 2.5
"""Maximum time from a current reading to the newest result, in reading periods."""

STIFFNESS_NAMES = (
    ("stiffness_n_per_m", "expected_n_per_m"),
    ("stiffness_of_kb", "expected_of_kb"),
)
"""Fields of stiffness and expected stiffness, for known and for unknown bracket stiffness."""

NOT_LEARNED, ATTITUDE_NOT_LEARNED = "condition_not_learned", "attitude_not_learned"


@dataclass(frozen=True)
class WatchedFilm:
    """Watched film with the findings of its newest reading.

    Parameters
    ----------
    rules
        Rules by which the films of the unit are judged.
    current
        Newest result of the bearing.
    news
        Newest reading with its findings; None without a reading since the service started.
    baseline
        Baseline in force; None without such a baseline.
    why_not_current
        Reason why the newest reading is not current; None if it is current.
    """

    rules: FilmRules
    current: CurrentBearing
    news: FilmNews | None
    baseline: BearingBaseline | None
    why_not_current: str | None


def why_unwatched(context: Context, unit: str, bearing: str) -> str | None:
    """Return the reason why a film is not watched; None if it is watched."""
    if unit in context.films.unwatched:
        return context.films.unwatched[unit]
    is_watched = context.films.place(unit, bearing) is not None
    return None if is_watched else "operating conditions require oil_temperature of the bearing"


def film_model(context: Context, unit: str, bearing: str) -> FilmModel:
    """Return the API model of the current state of the film of a bearing."""
    seen, place = _seen(context, unit, bearing), context.films.place(unit, bearing)
    x, y = _directions(seen) if seen else (None, None)
    return FilmModel.of(
        unit=unit,
        bearing=bearing,
        is_watched=seen is not None,
        why_not=why_unwatched(context, unit, bearing),
        estimator=place and place.estimator,
        time=seen.news.reading.time_ns if seen and seen.news else None,
        is_current=seen is not None and seen.why_not_current is None,
        next_reading=seen and _next_reading_ns(seen),
        condition=seen and _condition(seen),
        baseline_version=seen and _version(seen.baseline),
        limits=seen and _limits(seen.rules.change),
        damping_limits=seen and _limits(seen.rules.change_ck),
        x=x,
        y=y,
    )


def film_brief(context: Context, unit: str, bearing: str) -> FilmBriefModel:
    """Return the API model of the film summary of a bearing."""
    seen = _seen(context, unit, bearing)
    x, y = (_word(found) for found in _directions(seen)) if seen else (None, None)
    limits = _limits(seen.rules.change) if seen else None
    why_not = why_unwatched(context, unit, bearing)
    return FilmBriefModel(why_not=why_not, limits=limits, x=x, y=y)


def _limits(limits: ChangeLimits) -> FilmLimitsModel:
    percent = [round(100.0 * each, 6) for each in (limits.alert_change, limits.danger_change)]
    return FilmLimitsModel(alert_percent=percent[0], danger_percent=percent[1])


def _word(found: FilmDirectionModel) -> FilmWordModel:
    return FilmWordModel.of(
        found,
        change_percent=found.change and found.change.percent,
        deviation_percent=found.deviation and found.deviation.percent,
        ck_level=found.damping.level,
        ck_change_percent=found.damping.change and found.damping.change.percent,
    )


def _seen(context: Context, unit: str, bearing: str) -> WatchedFilm | None:
    rules = context.films.rules(unit)
    if rules is None or context.films.place(unit, bearing) is None:
        return None
    baseline = context.films.baseline(unit, bearing)
    news, current = context.films.newest(unit, bearing), context.live.current(unit, bearing)
    why = _why_not_current(news, current, rules, _version(baseline))
    return WatchedFilm(rules, current, news, baseline, why)


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


def _next_reading_ns(seen: WatchedFilm) -> int | None:
    """Return the time at which the next reading is due; None without current data."""
    newest, period_ns = seen.current.assessment, seen.rules.reading_ns
    if newest is None or not seen.current.is_current:
        return None
    return (newest.time_ns // period_ns + 1) * period_ns


def _condition(seen: WatchedFilm) -> FilmConditionModel | None:
    newest = seen.current.assessment
    if newest is None or newest.condition is None or not seen.current.is_current:
        return None
    return condition_model(newest.time_ns, newest.condition, seen.rules.grid)


def _directions(seen: WatchedFilm) -> tuple[FilmDirectionModel, FilmDirectionModel]:
    if seen.news is None or seen.why_not_current is not None:
        levels = [f.level for f in seen.news.findings] if seen.news else [None] * len(QUANTITIES)
        reason = seen.why_not_current or ""
        x, y = (_unread(reason, *map(level_name, levels[row::2])) for row in range(2))
        return x, y
    x, y = (_direction(seen, seen.news, row) for row in range(len(DIRECTIONS)))
    return x, y


def _unread(
    reason: str, level: LevelHeldName | None, ck_level: LevelHeldName | None
) -> FilmDirectionModel:
    """Return the state in a direction without a current reading: a reason and the alarm levels."""
    why = {"verdict": "no_reading", "reason": reason}
    unknown = dict.fromkeys(("change", "deviation", "cause"), None)
    ck = FilmDampingModel.of(**why, level=ck_level, **unknown, ck_s=None, expected_s=None)
    values = dict.fromkeys(chain(*STIFFNESS_NAMES), None)
    return FilmDirectionModel.of(**why, level=level, **unknown, **values, damping=ck)


def _direction(seen: WatchedFilm, news: FilmNews, row: int) -> FilmDirectionModel:
    ck = row + len(DIRECTIONS)
    k_n_per_m, expected_n_per_m = _with_expected(news, row)
    names = STIFFNESS_NAMES[bool(are_ratios(news.reading.values[row].ln_k))]
    values = dict.fromkeys(chain(*STIFFNESS_NAMES), None)
    ck_s, expected_s = _with_expected(news, ck)
    return FilmDirectionModel.of(
        **_decided(seen, news, row),
        **values | dict(zip(names, (k_n_per_m, expected_n_per_m), strict=True)),
        damping=FilmDampingModel.of(**_decided(seen, news, ck), ck_s=ck_s, expected_s=expected_s),
    )


def _decided(seen: WatchedFilm, news: FilmNews, row: int) -> dict[str, Any]:
    """Return the fields of `FilmQuantityModel`, of a row of `QUANTITIES`."""
    finding, rules = news.findings[row], seen.rules
    return {
        "verdict": finding.verdict,
        "reason": _reason(seen, news.reading, finding),
        "level": level_name(finding.level),
        "change": _change(finding, news.decisions[row], rules),
        "deviation": _deviation(finding),
        "cause": finding.attribution,
    }


def _with_expected(news: FilmNews, row: int) -> list[float | None]:
    """Return the value and the expected value of a row of `QUANTITIES`; None if unknown."""
    finding = news.findings[row]
    quantity = QUANTITIES[finding.quantity]
    value = getattr(news.reading.values[quantity.row], quantity.value)
    expected = math.nan if finding.deviation is None else value - finding.deviation
    return [None if math.isnan(each) else math.exp(each) for each in (value, expected)]


def _reason(seen: WatchedFilm, reading: FilmReading, finding: FilmFinding) -> str:
    match finding.verdict:
        case Verdict.NO_BASELINE:
            learned = seen.baseline.of(finding.quantity) if seen.baseline else None
            return "none_in_force" if learned is None else _unseen(learned, reading)
        case Verdict.TRANSIENT:
            return "not_settled"
        case _:
            return reading.values[QUANTITIES[finding.quantity].row].reason.value


def _unseen(learned: QuantityBaseline, reading: FilmReading) -> str:
    """Return why the baseline does not cover a reading: cell or attitude angle not learned."""
    is_seen = learned.table.find(learned.grid.cells(reading.conditions))[0] >= 0
    return ATTITUDE_NOT_LEARNED if is_seen else NOT_LEARNED


def _change(finding: FilmFinding, decision: Decision, rules: FilmRules) -> FilmChangeModel | None:
    change, std, time_scale_h = finding.change, finding.change_std, finding.time_scale_h
    if change is None or std is None or time_scale_h is None:
        return None
    counted_ns = decision.last_counted_ns
    return FilmChangeModel.of(
        finding,
        percent=percent_of(change),
        significance=abs(change) / std,
        significance_wanted=rules.limits(finding.quantity).significance_threshold(time_scale_h),
        as_of=None if counted_ns is None else round(counted_ns / rules.time_lapse),
    )


def _deviation(finding: FilmFinding) -> FilmDeviationModel | None:
    interval = finding.deviation_95_percent
    if finding.deviation is None or interval is None:
        return None
    low, high = interval
    return FilmDeviationModel(percent=percent_of(finding.deviation), low_95=low, high_95=high)


def verdict_name(verdict: Verdict) -> VerdictName:
    """Return the name of a verdict in the API."""
    return cast("VerdictName", verdict.name.lower())


def level_name(level: int | None) -> LevelHeldName | None:
    """Return the name of an alarm level in the API; None for None."""
    return None if level is None else cast("LevelHeldName", Verdict(int(level)).name.lower())


def watched_place(context: Context, unit: str, bearing: str) -> FilmPlace:
    """Return unit, bearing and estimator of a film; raise a problem if the film is not watched."""
    context.bearing(unit, bearing)
    place = context.films.place(unit, bearing)
    if place is None:
        detail = f"the film of unit {unit} bearing {bearing} is not watched: "
        raise ProblemError(409, "Not watched", f"{detail}{why_unwatched(context, unit, bearing)}")
    return place


def film_router(context: Context) -> APIRouter:
    """Return the router for the current state of a film."""
    router = subject_router("/units/{unit}/bearings/{bearing}/film", "film")

    @router.get(
        "", summary="A film now", response_model=FilmModel, responses=problem_responses(404)
    )
    async def film(request: Request, unit: UnitId, bearing: BearingId) -> Response:
        """Return verdict, change of stiffness and cause in x and y, and the operating condition.

        A film that cannot be judged is never reported as normal; its verdict states the reason.
        """
        context.bearing(unit, bearing)
        make = partial(film_model, context, unit, bearing)
        return await context.answers.of(
            request, partial(context.now_revision, unit), make, lambda _: make
        )

    return router
