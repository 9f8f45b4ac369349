"""One bearing: as configured, now, as spectrum and as orbit."""

import asyncio
from datetime import datetime
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Query, Response
from pydantic import BeforeValidator

from core.monitor.catalogue import BY_NAME
from core.samples.gaps import Gap
from core.stiffness.estimators import ESTIMATORS
from core.units import ns_from_s
from service.api.auth.declared import needs
from service.api.bearing_models import BearingModel
from service.api.bearing_views import bearing_model
from service.api.budget_models import BudgetModel
from service.api.context import BearingId, Context, QuantityName, UnitId
from service.api.models import LatestModel
from service.api.parameters import ns_from_datetime, require_order, written_as_date
from service.api.problems import ProblemError, problem_responses
from service.api.rendering import Renderings, rendered
from service.api.series_models import GapModel, OrbitModel, SpectrumModel
from service.api.views import (
    budget_model,
    latest_model,
    orbit_model,
    spectrum_model,
)
from service.live.live_view import CurrentBearing
from service.runtime.times import rfc3339
from service.store.access.identities import Permission
from service.store.value_range import ValueRange

Moment = Annotated[datetime, BeforeValidator(written_as_date)]
Start = Annotated[
    Moment,
    Query(description="First time, RFC 3339 with offset.", examples=["2026-11-21T08:00:00Z"]),
]
End = Annotated[
    Moment,
    Query(description="Time up to which, RFC 3339 with offset.", examples=["2026-11-21T09:00:00Z"]),
]


def _bound(words: str, example: float) -> Any:
    return Query(allow_inf_nan=False, description=words, examples=[example])


async def time_range(start: Start, end: End) -> tuple[int, int]:
    """Check a range of time."""
    start_ns, end_ns = ns_from_datetime(start, "start"), ns_from_datetime(end, "end")
    require_order(start_ns, end_ns)
    return start_ns, end_ns


async def eccentricity_range(
    eccentricity_min: Annotated[float | None, _bound("Lowest eccentricity ratio.", 0.2)] = None,
    eccentricity_max: Annotated[float | None, _bound("Highest eccentricity ratio.", 0.4)] = None,
) -> ValueRange:
    """Results with an eccentricity ratio within these bounds."""
    return _ordered(eccentricity_min, eccentricity_max, "eccentricity_min")


async def oil_temperature_range(
    oil_temperature_min: Annotated[float | None, _bound("Lowest, °C.", 40.0)] = None,
    oil_temperature_max: Annotated[float | None, _bound("Highest, °C.", 50.0)] = None,
) -> ValueRange:
    """Results with an oil temperature, in °C, within these bounds."""
    return _ordered(oil_temperature_min, oil_temperature_max, "oil_temperature_min")


async def attitude_range(
    attitude_min: Annotated[float | None, _bound("Lowest attitude angle, degrees.", 40.0)] = None,
    attitude_max: Annotated[float | None, _bound("Highest, degrees.", 50.0)] = None,
) -> ValueRange:
    """What was found at an attitude angle within these bounds."""
    return _ordered(attitude_min, attitude_max, "attitude_min")


TimeRange = Annotated[tuple[int, int], Depends(time_range)]


def bearing_router(context: Context) -> APIRouter:
    """Routes about one bearing."""
    router = APIRouter(
        prefix="/api/v1/units/{unit}/bearings",
        tags=["bearing"],
        dependencies=[needs(Permission.READ)],
    )
    unknown, no_result = problem_responses(404), problem_responses(404, 409)
    spectra, orbits = Renderings(), Renderings()

    @router.get("", summary="All bearings of a unit", responses=unknown)
    async def bearings(unit: UnitId) -> list[BearingModel]:
        """The unit's guide bearings as configured, with their references in force."""
        return [_bearing(context, unit, bearing.id) for bearing in context.unit(unit).bearing]

    @router.get("/{bearing}", summary="One bearing as configured", responses=unknown)
    async def one_bearing(unit: UnitId, bearing: BearingId) -> BearingModel:
        """Bracket, clearance, channels, and the reference in force with where it comes from."""
        return _bearing(context, unit, bearing)

    @router.get(
        "/{bearing}/latest",
        summary="One bearing now",
        response_model=LatestModel,
        responses=unknown,
    )
    async def latest(unit: UnitId, bearing: BearingId) -> Response:
        """The newest result, without numbers where they are not current."""
        context.bearing(unit, bearing)
        return await rendered(lambda: latest_model(context.live, unit, bearing))

    @router.get("/{bearing}/budgets/{quantity}", summary="Uncertainty budget", responses=no_result)
    async def budget(unit: UnitId, bearing: BearingId, quantity: QuantityName) -> BudgetModel:
        """Where the uncertainty of the newest result of a quantity comes from."""
        context.bearing(unit, bearing)
        if quantity not in BY_NAME or not BY_NAME[quantity].has_uncertainty:
            detail = f"quantity {quantity!r} has no uncertainty budget; see /api/v1/quantities"
            raise ProblemError(404, "No such budget", detail)
        found = _budget(context.live.current(unit, bearing), quantity)
        if found is None:
            detail = f"{quantity} has no budget just now: no number, or too few segments yet"
            raise ProblemError(409, "No result", detail)
        return found

    @router.get(
        "/{bearing}/spectrum",
        summary="Spectra",
        response_model=SpectrumModel,
        responses=no_result,
    )
    async def spectrum(unit: UnitId, bearing: BearingId) -> Response:
        """Averaged amplitude spectra of the newest result, all channels as displacement."""
        context.bearing(unit, bearing)
        assessment = context.live.assessment(unit, bearing)
        if assessment is None:
            raise _no_result(unit, bearing)
        return await spectra.of((unit, bearing), assessment, spectrum_model)

    @router.get("/{bearing}/orbit", summary="Orbit", response_model=OrbitModel, responses=no_result)
    async def orbit(unit: UnitId, bearing: BearingId) -> Response:
        """The newest turns of the shaft relative to the bearing."""
        context.bearing(unit, bearing)
        assessment = context.live.assessment(unit, bearing)
        if assessment is None or assessment.orbit is None:
            raise _no_result(unit, bearing)
        return await orbits.of((unit, bearing), assessment.orbit, orbit_model)

    return router


def gap_router(context: Context) -> APIRouter:
    """Routes about holes in the samples of a unit."""
    router = APIRouter(
        prefix="/api/v1/units/{unit}", tags=["plant"], dependencies=[needs(Permission.READ)]
    )

    @router.get("/gaps", summary="Gaps", responses=problem_responses(404, 422, 503))
    async def gaps(unit: UnitId, times: TimeRange) -> list[GapModel]:
        """Recorded gaps in the samples of a unit, stops of the service too, by when they ended."""
        found = await asyncio.to_thread(context.store.gaps, context.unit(unit).id, *times)
        rate_hz = context.unit(unit).sampling_hz
        return [_gap_model(gap, rate_hz) for gap in found]

    return router


def _gap_model(gap: Gap, rate_hz: float) -> GapModel:
    start_ns = gap.start_ns
    if start_ns is None:
        start_ns = gap.stop_ns - ns_from_s(gap.n_samples / rate_hz)
    return GapModel(
        epoch=gap.epoch,
        first_index=gap.first_index,
        n_samples=gap.n_samples,
        start=rfc3339(start_ns),
        end=rfc3339(gap.stop_ns),
        is_estimated=gap.is_estimated,
    )


def _bearing(context: Context, unit: str, bearing: str) -> BearingModel:
    context.bearing(unit, bearing)
    references = context.references
    watched = references.bearing(unit, bearing)
    return bearing_model(unit, watched, references.of(unit, bearing))


def _budget(current: CurrentBearing, quantity: str) -> BudgetModel | None:
    """Budget of a current reading; the preferred stiffness has that of its estimator."""
    assessment = current.assessment
    if assessment is None or not current.is_current:
        return None
    source = quantity
    if quantity.startswith("stiffness_"):
        axes = quantity.split("_")[1]
        estimator = assessment.estimators[axes]
        source = ESTIMATORS[estimator].stiffness.format(axes=axes) if estimator else quantity
    budget = assessment.budgets.get(source)
    return None if budget is None else budget_model(quantity, assessment.time_ns, budget)


def _ordered(low: float | None, high: float | None, parameter: str) -> ValueRange:
    if low is not None and high is not None and low > high:
        detail = f"{parameter} {low:g} must not be above its maximum {high:g}"
        raise ProblemError(422, "Wrong parameter", detail, parameter)
    return ValueRange(low, high)


def _no_result(unit: str, bearing: str) -> ProblemError:
    detail = f"unit {unit!r} bearing {bearing!r} has no result yet; the first takes one segment"
    return ProblemError(409, "No result yet", detail)
