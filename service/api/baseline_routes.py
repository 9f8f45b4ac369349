"""The baselines of a bearing: what was learned, and what engineers do to it."""

import asyncio
from typing import Annotated, Any

from fastapi import APIRouter, Path, Response

from core.baseline.baseline import BearingBaseline
from service.api.auth.actors import actor_or
from service.api.auth.declared import needs
from service.api.baseline_models import (
    BaselineActionModel,
    BaselineModel,
    BaselinesModel,
    RenewModel,
)
from service.api.baseline_views import (
    baseline_model,
    estimator_name,
    learning_model,
    step_model,
    version_model,
)
from service.api.context import BearingId, Context, UnitId
from service.api.film_routes import watched_place
from service.api.parameters import ns_from_datetime
from service.api.problems import ProblemError, described_problems, problem_responses
from service.api.rendering import rendered, worked
from service.live.commands import (
    Accept,
    BaselineAction,
    BaselineRefusedError,
    Freeze,
    Reject,
    Renew,
    Thaw,
)
from service.live.learning_progress import learning_progress
from service.runtime.times import rfc3339
from service.store.access.identities import Permission
from service.store.baselines import versions_after
from service.store.documents import BASELINE, FORMAT_VERSION, to_json

Version = Annotated[int, Path(ge=1, le=10**15, description="Version of a baseline.", examples=[3])]

READING_PROBLEMS = problem_responses(404, 422, 503)

ACTION_PROBLEMS = described_problems(
    {
        403: "Not allowed, or asked for by a page of another site",
        404: "Unknown unit, bearing or version",
        409: "Does not fit the baselines as they are now, or the film is not watched",
        422: "A wrong parameter",
        503: "Not done: the store cannot be written",
    }
)

EXPORTED: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "The baseline as a document.",
        "content": {
            "application/json": {
                "schema": {"type": "object"},
                "example": {"format": BASELINE, "format_version": FORMAT_VERSION, "content": {}},
            }
        },
    }
}


def baseline_router(context: Context) -> APIRouter:
    """Routes that show baselines."""
    router = APIRouter(
        prefix="/api/v1/units/{unit}/bearings/{bearing}/baselines",
        tags=["baselines"],
        dependencies=[needs(Permission.READ)],
    )

    @router.get(
        "",
        summary="Baselines of a bearing",
        response_model=BaselinesModel,
        responses=problem_responses(404, 503),
    )
    async def baselines(unit: UnitId, bearing: BearingId) -> Response:
        """Every version, which of them is in force, what was done, and how far learning is."""
        context.bearing(unit, bearing)
        return await rendered(lambda: _baselines(context, unit, bearing))

    @router.get(
        "/{version}",
        summary="One baseline",
        response_model=BaselineModel,
        responses=READING_PROBLEMS,
    )
    async def one_baseline(unit: UnitId, bearing: BearingId, version: Version) -> Response:
        """Its cells by column: bounds, stiffness, scatter, and whether readings count there."""
        context.bearing(unit, bearing)
        return await rendered(lambda: _baseline(context, unit, bearing, version))

    @router.get(
        "/{version}/export",
        summary="A baseline as a document",
        responses={**READING_PROBLEMS, **EXPORTED},
        response_class=Response,
    )
    async def export(unit: UnitId, bearing: BearingId, version: Version) -> Response:
        """The whole baseline, with its surface, as a file that padwatch reads back to the bit."""
        context.bearing(unit, bearing)
        found = await worked(lambda: to_json(_stored(context, unit, bearing, version)))
        name = f"{unit}-{bearing}-baseline-{version}.json"
        headers = {"Content-Disposition": f'attachment; filename="{name}"'}
        return Response(found, headers=headers, media_type="application/json")

    return router


def baseline_action_router(context: Context) -> APIRouter:
    """Routes that engineers act by; each answers with the baselines as they are then, stored."""
    router = APIRouter(
        prefix="/api/v1/units/{unit}/bearings/{bearing}/baselines",
        tags=["baselines"],
        dependencies=[needs(Permission.CHANGE_MEASURING)],
    )

    @router.post("/{version}/accept", summary="Accept a baseline", responses=ACTION_PROBLEMS)
    async def accept(
        unit: UnitId, bearing: BearingId, version: Version, asked: BaselineActionModel
    ) -> BaselinesModel:
        """Compare the bearing with this version from its next reading on."""
        await asyncio.to_thread(_require_version, context, unit, bearing, version)
        return await _done(context, unit, bearing, Accept(version), asked)

    @router.post("/{version}/reject", summary="Reject a baseline", responses=ACTION_PROBLEMS)
    async def reject(
        unit: UnitId, bearing: BearingId, version: Version, asked: BaselineActionModel
    ) -> BaselinesModel:
        """Compare with this version no longer; if it is in force, with nothing until another is."""
        await asyncio.to_thread(_require_version, context, unit, bearing, version)
        return await _done(context, unit, bearing, Reject(version), asked)

    @router.post("/freeze", summary="Learn no further", responses=ACTION_PROBLEMS)
    async def freeze(
        unit: UnitId, bearing: BearingId, asked: BaselineActionModel
    ) -> BaselinesModel:
        """Keep the version in force; nothing more is learned until somebody thaws it."""
        return await _done(context, unit, bearing, Freeze(), asked)

    @router.post("/thaw", summary="Learn again", responses=ACTION_PROBLEMS)
    async def thaw(unit: UnitId, bearing: BearingId, asked: BaselineActionModel) -> BaselinesModel:
        """End a freeze; learning goes on in its learning period."""
        return await _done(context, unit, bearing, Thaw(), asked)

    @router.post("/renew", summary="Begin again", responses=ACTION_PROBLEMS)
    async def renew(unit: UnitId, bearing: BearingId, asked: RenewModel) -> BaselinesModel:
        """Begin a new baseline after a machine event, such as an overhaul.

        Nothing is in force until enough readings from after the event have been learned.
        """
        from_ns = ns_from_datetime(asked.event_time, "event_time")
        if from_ns < 0:
            detail = f"event_time {rfc3339(from_ns)} lies before 1970"
            raise ProblemError(422, "Wrong parameter", detail, "event_time")
        return await _done(context, unit, bearing, Renew(from_ns), asked)

    return router


async def _done(
    context: Context, unit: str, bearing: str, action: BaselineAction, asked: BaselineActionModel
) -> BaselinesModel:
    """Do it, and answer when it is on the disk."""
    place = watched_place(context, unit, bearing)
    try:
        await context.operators.act(place, action, actor_or(asked.actor), asked.reason)
    except BaselineRefusedError as error:
        raise ProblemError(409, "Does not fit", f"{unit} {bearing}: {error}") from error
    return await asyncio.to_thread(_baselines, context, unit, bearing)


def _baselines(context: Context, unit: str, bearing: str) -> BaselinesModel:
    store, settings = context.store.films, context.films.settings
    entries, steps = list(store.baselines(unit, bearing)), list(store.steps(unit, bearing))
    versions, place = versions_after(steps), context.films.place(unit, bearing)
    progress = (
        learning_progress(store, place, versions, entries, settings, context.clock.now_ns())
        if place
        else None
    )
    renewed_ns, n_days = versions.renewed_ns, settings.baseline.min_learning_days
    return BaselinesModel(
        unit=unit,
        bearing=bearing,
        estimator=estimator_name(place.estimator if place else None),
        in_force=versions.in_force,
        is_frozen=versions.is_frozen,
        renewed=None if renewed_ns is None else rfc3339(renewed_ns),
        acceptance=settings.acceptance,
        learning=learning_model(progress, n_days) if progress else None,
        versions=[version_model(entry, versions, steps) for entry in entries],
        steps=[step_model(step) for step in reversed(steps)],
    )


def _baseline(context: Context, unit: str, bearing: str, version: int) -> BaselineModel:
    found, store = _stored(context, unit, bearing, version), context.store.films
    steps = list(store.steps(unit, bearing))
    [entry] = [one for one in store.baselines(unit, bearing) if one.version == version]
    return baseline_model(found, version_model(entry, versions_after(steps), steps))


def _stored(context: Context, unit: str, bearing: str, version: int) -> BearingBaseline:
    found = context.store.films.baseline(unit, bearing, version)
    if found is None:
        raise _unknown_version(unit, bearing, version)
    return found


def _require_version(context: Context, unit: str, bearing: str, version: int) -> None:
    context.bearing(unit, bearing)
    entries = context.store.films.baselines(unit, bearing)
    if version not in [entry.version for entry in entries]:
        raise _unknown_version(unit, bearing, version)


def _unknown_version(unit: str, bearing: str, version: int) -> ProblemError:
    detail = f"unit {unit!r} bearing {bearing!r} has no baseline {version}"
    return ProblemError(404, "Unknown baseline", detail)
