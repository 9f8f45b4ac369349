"""Route for the current state of an oil film: verdict, change of stiffness, cause, condition."""

import math
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, Literal

from fastapi import Request, Response
from pydantic import Field

from core.baseline.baseline import BearingBaseline
from core.baseline.history import DIRECTIONS, QUANTITIES, are_ratios
from core.change.decision import Decision, Verdict
from core.change.film_judge import FilmFinding, FilmNews
from core.change.film_reading import FilmReading
from core.change.settings import ChangeLimits, FilmRules, percent_of
from core.machine.unit import Estimator
from service.api.auth.gate import GuardedRouter, subject_router
from service.api.context import BearingId, Context, UnitId
from service.api.problems import ProblemError
from service.api.values import (
    ApiModel,
    BearingAnswer,
    ByName,
    FilmConditionModel,
    Time,
    condition_model,
)
from service.live.commands import FilmPlace
from service.live.models import FilmCauseModel
from service.settings.alarm_kinds import AlarmLevelName

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


class FilmChangeModel(ApiModel):
    """Mean deviation from the baseline over the averaging time at which it is most significant."""

    time_scale_h: Annotated[float, Field(examples=[4.0])]
    """Averaging time, running hours."""

    percent: Annotated[float, Field(examples=[-19.2])]
    """Mean change, % of the expected value; negative if softer. The alarm limits apply to it.
    After a sudden change, it follows the deviation of the newest reading with delay."""

    significance: Annotated[float, Field(examples=[12.4])]
    """Absolute value of the change, divided by its standard uncertainty."""

    significance_wanted: Annotated[float, Field(examples=[6.5])]
    """Smallest significance at which a change with this averaging time can raise an alarm."""

    as_of: Time | None
    """Time of the newest reading in the average; null if this reading was made before the service
    started or before the baseline in force."""


class FilmDeviationModel(ApiModel):
    """Deviation of one reading from the baseline."""

    low_95: float
    high_95: float

    percent: float
    """Deviation, % of the expected stiffness."""


class FilmVerdictModel(ApiModel):
    """Verdict and alarm level of a film in one direction, x or y."""

    verdict: Annotated[VerdictName, ByName]
    """Verdict on the newest reading. Only "normal", "alert" and "danger" judge the film. The other
    verdicts state why it is not judged: too little evidence yet ("gathering_evidence"), no baseline
    for this condition ("no_baseline"), too little motion ("insufficient_excitation"), a doubtful
    value ("bad_quality"), a unit that has not settled ("transient"), or no current reading
    ("no_reading")."""

    level: Annotated[AlarmLevelName, ByName] | None
    """Alarm level in force, also while the newest reading cannot be judged; null if none."""


class FilmStiffnessModel(ApiModel):
    """Stiffness of a film in one direction, and the stiffness that its baseline expects."""

    stiffness_n_per_m: float | None
    stiffness_of_kb: float | None

    expected_n_per_m: float | None
    """Stiffness that the baseline expects under the condition of the newest reading, N/m; null if
    this reading was not compared."""

    expected_of_kb: float | None
    """Expected stiffness as such a ratio; null if the bracket stiffness is known."""


class FilmQuantityModel(FilmVerdictModel):
    """Verdict on a quantity of an oil film in one direction, x or y, with its change."""

    reason: Annotated[str, Field(examples=["condition_not_learned"])]
    """Reason why the film is not judged; "ok" if it is judged."""

    change: FilmChangeModel | None
    """Change against the baseline; null without a baseline, until the shortest averaging time has
    passed, and without a current reading."""

    deviation: FilmDeviationModel | None
    """Deviation of the newest reading alone; null if this reading was not compared."""

    cause: FilmCauseModel | None
    """Cause of the change while a level is in force; otherwise null."""


class FilmDampingModel(FilmQuantityModel):
    """Verdict on the ratio c/k of damping to stiffness of an oil film, with its change."""

    ck_s: float | None

    expected_s: float | None
    """Damping over stiffness that the baseline expects, s; null if it was not compared."""


class FilmDirectionModel(FilmQuantityModel, FilmStiffnessModel):
    """State of an oil film in one direction, x or y: stiffness, and damping over stiffness."""

    damping: FilmDampingModel


class FilmLimitsModel(ApiModel):
    """Alarm limits of the mean change of a film, separately for an increase and a decrease."""

    alert_percent: Annotated[float, Field(examples=[3.5])]
    """Limit for an alert, % of the expected value."""

    danger_percent: Annotated[float, Field(examples=[15.0])]
    """Limit for danger, % of the expected value."""


class FilmModel(BearingAnswer):
    """Current state of the oil film of a bearing."""

    why_not: str | None
    estimator: Estimator | None
    baseline_version: int | None
    limits: FilmLimitsModel | None
    x: FilmDirectionModel | None
    y: FilmDirectionModel | None

    is_watched: bool
    """Whether the film is watched: its stiffness is compared with a baseline."""

    time: Time | None
    """Time of the newest reading; null without a reading since the service started."""

    is_current: bool
    """Whether the newest reading is recent and the baseline in force has not changed since then."""

    next_reading: Time | None
    """Time at which the next reading is due; null without current data."""

    condition: FilmConditionModel | None
    """Operating condition of the bearing at the newest result; null without current data."""

    damping_limits: FilmLimitsModel | None
    """Alarm limits of damping over stiffness; null if the film is not watched."""


class FilmWordModel(FilmVerdictModel, FilmStiffnessModel):
    """Verdict, alarm level, stiffness and change of a film in one direction."""

    change_percent: float | None
    deviation_percent: float | None
    ck_level: AlarmLevelName | None
    ck_change_percent: float | None


class FilmBriefModel(ApiModel):
    """Summary of the oil film of a bearing."""

    why_not: str | None
    limits: FilmLimitsModel | None
    x: FilmWordModel | None
    y: FilmWordModel | None


CURRENT_PERIODS = 2.5
"""Maximum time from a current reading to the newest result, in reading periods."""


@dataclass(frozen=True)
class WatchedFilm:
    """Watched film with the findings of its newest reading.

    Parameters
    ----------
    rules
        Rules by which the films of the unit are judged.
    news
        Newest reading with its findings; None without a reading since the service started.
    baseline
        Baseline in force; None if no baseline is in force.
    why_not_current
        Reason why the newest reading is not current; None if it is current.
    """

    rules: FilmRules
    news: FilmNews | None
    baseline: BearingBaseline | None
    why_not_current: str | None

    @property
    def current(self) -> FilmNews | None:
        """Newest reading with its findings; None if it is not current."""
        return self.news if self.why_not_current is None else None


def why_unwatched(context: Context, unit: str, bearing: str) -> str | None:
    """Return the reason why a film is not watched; None if it is watched."""
    if unit in context.films.unwatched:
        return context.films.unwatched[unit]
    is_watched = context.films.place(unit, bearing) is not None
    return None if is_watched else "operating conditions require oil_temperature of the bearing"


def film_model(context: Context, unit: str, bearing: str) -> FilmModel:
    """Return the API model of the current state of the film of a bearing."""
    seen, place = _seen(context, unit, bearing), context.films.place(unit, bearing)
    current = context.live.current(unit, bearing)
    now = current.assessment if current.is_current else None
    grid, period_ns = (seen.rules.grid, seen.rules.reading_ns) if seen else (None, 0)
    x, y = _directions(seen) if seen else (None, None)
    return FilmModel.of(
        unit=unit,
        bearing=bearing,
        is_watched=seen is not None,
        why_not=why_unwatched(context, unit, bearing),
        estimator=place and place.estimator,
        time=seen.news.reading.time_ns if seen and seen.news else None,
        is_current=seen is not None and seen.current is not None,
        next_reading=(now.time_ns // period_ns + 1) * period_ns if seen and now else None,
        condition=grid
        and now
        and now.condition
        and condition_model(now.time_ns, now.condition, grid),
        baseline_version=seen and seen.baseline and seen.baseline.origin.version,
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
    baseline, why = context.films.baseline(unit, bearing), None
    news, current = context.films.newest(unit, bearing), context.live.current(unit, bearing)
    if current.assessment is None or not current.is_current:
        why = current.quality.reason.value
    elif news is None:
        why = "waiting_for_data"
    elif current.assessment.time_ns - news.reading.time_ns > CURRENT_PERIODS * rules.reading_ns:
        why = "stale"
    elif news.findings[0].baseline_version != (baseline and baseline.origin.version):
        why = "baseline_changed"
    return WatchedFilm(rules, news, baseline, why)


def _directions(seen: WatchedFilm) -> list[FilmDirectionModel]:
    return [_direction(seen, row) for row in range(len(DIRECTIONS))]


def _direction(seen: WatchedFilm, row: int) -> FilmDirectionModel:
    ck = row + len(DIRECTIONS)
    unknown: list[float | None] = [None, None]
    k, of_kb = _with_expected(seen, row), unknown
    if seen.current is not None and are_ratios(seen.current.reading.values[row].ln_k):
        k, of_kb = unknown, k
    ck_s, expected_s = _with_expected(seen, ck)
    return FilmDirectionModel.of(
        **_decided(seen, row),
        stiffness_n_per_m=k[0],
        expected_n_per_m=k[1],
        stiffness_of_kb=of_kb[0],
        expected_of_kb=of_kb[1],
        damping=FilmDampingModel.of(**_decided(seen, ck), ck_s=ck_s, expected_s=expected_s),
    )


def _decided(seen: WatchedFilm, row: int) -> dict[str, Any]:
    """Return the fields of `FilmQuantityModel`, of a row of `QUANTITIES`."""
    news, rules = seen.current, seen.rules
    if news is None:
        level = seen.news and seen.news.findings[row].level
        why = {"verdict": "no_reading", "reason": seen.why_not_current, "level": level}
        return why | dict.fromkeys(("change", "deviation", "cause"), None)
    finding = news.findings[row]
    return {
        "verdict": finding.verdict,
        "reason": _reason(seen, news.reading, finding),
        "level": finding.level,
        "change": _change(finding, news.decisions[row], rules),
        "deviation": _deviation(finding),
        "cause": finding.attribution,
    }


def _with_expected(seen: WatchedFilm, row: int) -> list[float | None]:
    """Return the value and the expected value of a row of `QUANTITIES`; None if unknown."""
    if seen.current is None:
        return [None, None]
    finding = seen.current.findings[row]
    quantity = QUANTITIES[finding.quantity]
    value = getattr(seen.current.reading.values[quantity.row], quantity.value)
    expected = math.nan if finding.deviation is None else value - finding.deviation
    return [None if math.isnan(each) else math.exp(each) for each in (value, expected)]


def _reason(seen: WatchedFilm, reading: FilmReading, finding: FilmFinding) -> str:
    match finding.verdict:
        case Verdict.NO_BASELINE:
            learned = seen.baseline.of(finding.quantity) if seen.baseline else None
            if learned is None:
                return "none_in_force"
            is_seen = learned.table.find(learned.grid.cells(reading.conditions))[0] >= 0
            return "attitude_not_learned" if is_seen else "condition_not_learned"
        case Verdict.TRANSIENT:
            return "not_settled"
        case _:
            return reading.values[QUANTITIES[finding.quantity].row].reason.value


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


def watched_place(context: Context, unit: str, bearing: str) -> FilmPlace:
    """Return unit, bearing and estimator of a film; raise a problem if the film is not watched."""
    place = context.films.place(unit, bearing)
    if place is None:
        detail = f"the film of unit {unit} bearing {bearing} is not watched: "
        raise ProblemError(409, "Not watched", f"{detail}{why_unwatched(context, unit, bearing)}")
    return place


def film_router(context: Context) -> GuardedRouter:
    """Return the router for the current state of a film."""
    router = subject_router("/units/{unit}/bearings/{bearing}/film", "film")

    @router.get("", response_model=FilmModel)
    async def film_now(request: Request, unit: UnitId, bearing: BearingId) -> Response:
        """Return verdict, change of stiffness and cause in x and y, and the operating condition.

        A film that cannot be judged is never reported as normal; its verdict states the reason.
        """
        make = partial(film_model, context, unit, bearing)
        revision = partial(context.now_revision, unit)
        return await context.answers.of(request, revision, make, is_polled=True)

    return router
