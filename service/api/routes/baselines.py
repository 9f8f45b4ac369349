"""Routes for the stiffness baselines of a bearing, and for changes of baselines by engineers."""

import asyncio
from typing import Annotated, Literal

import numpy as np
from fastapi import Path, Response
from pydantic import Field

from core.baseline.baseline import BearingBaseline, QuantityBaseline
from core.baseline.cell_table import CellStatistics
from core.baseline.history import absolute_and_ratio
from core.condition.cells import CellGrid
from core.machine.unit import Estimator
from service.api.answers import rendered
from service.api.auth.gate import GuardedRouter, actor_or, needs, subject_router
from service.api.context import BearingId, Context, UnitId
from service.api.downloads import file_content
from service.api.parameters import Moment, ns_from_datetime
from service.api.problems import ProblemError, problem_responses
from service.api.routes.films import watched_place
from service.api.routes.learning import LearningModel, learning_model
from service.api.values import (
    ApiModel,
    BearingAnswer,
    CellModel,
    ReasonModel,
    Time,
    cell_model,
    listed,
)
from service.live import commands
from service.live.models import BaselineOriginModel
from service.runtime.times import rfc3339
from service.store.access.identities import Permission
from service.store.baselines import (
    BaselineEntry,
    BaselineStep,
    StoredStep,
    Versions,
    versions_after,
)
from service.store.documents import BASELINE, FORMAT_VERSION, to_json

BaselineStatusName = Literal["in_force", "rejected", "superseded", "learned"]


class BaselineVersionModel(BaselineOriginModel, ApiModel):
    """Version of the learned baseline of a bearing, without its cells."""

    estimator: Estimator

    status: BaselineStatusName
    """Status: in force; rejected by an engineer; superseded by another version or by a machine
    event; or learned and not yet accepted by an engineer."""

    remark: Annotated[str, Field(examples=["x is 5.1 % below that of version 1"])]
    """Reason why this version was not accepted automatically, remark on its readings, or empty."""

    is_frozen: bool
    """Whether this version is in force and an engineer has frozen learning."""


class BaselinesModel(BearingAnswer):
    """All baseline versions of a bearing, and their history."""

    estimator: Estimator | None

    in_force: int | None
    """Number of the version in force; null if no version is in force."""

    is_frozen: bool
    """Whether an engineer has frozen learning."""

    renewed: Time | None
    """Time of the newest machine event; earlier readings are not used. Null without an event."""

    acceptance: Literal["automatic", "by_engineer"]
    """Acceptance of learned baselines: "automatic" if a baseline agrees with the previous one, or
    always "by_engineer"."""

    learning: LearningModel | None
    """Progress of learning; null if the bearing is not watched."""

    versions: list[BaselineVersionModel]
    """Versions of the baseline, newest first."""

    steps: list[StoredStep]
    """Steps in the history of the baselines, newest first."""


class BaselineCellsModel(ApiModel):
    """Cells of a baseline in the grid of operating conditions, one value per cell in each list."""

    eccentricity_low: list[float]
    eccentricity_high: list[float]
    oil_temperature_low_c: list[float]
    oil_temperature_high_c: list[float]
    attitude_low_deg: list[float] | None
    attitude_high_deg: list[float] | None
    stiffness_of_kb: list[float | None]

    eccentricity_ratio: list[float]
    """Median eccentricity ratio of the readings in the cell."""

    oil_temperature_c: list[float]
    """Median oil temperature of the readings in the cell, °C."""

    n_readings: list[int]
    """Number of readings learned in the cell; 0 in a cell without readings between other cells."""

    n_days: list[int]
    """Number of days with readings in the cell."""

    stiffness_n_per_m: list[float | None]
    """Median stiffness of the readings, or of the fitted surface without readings, N/m; null if the
    bracket stiffness was unknown."""

    scatter_percent: list[float]
    """Robust standard deviation of single readings about the fitted stiffness surface, %."""

    surface_std_percent: list[float]
    """Standard uncertainty of the fitted surface at the median condition of the cell, %."""

    support: list[Literal["own", "borrowed", "none"]]
    """Basis on which new readings in the cell are judged: learned readings of the cell ("own"), of
    neighbouring cells ("borrowed"), or no basis ("none")."""


class BaselineDirectionModel(ApiModel):
    """Learned stiffness of an oil film in one direction, x or y."""

    scatter_percent: float
    """Standard deviation of single readings about the fitted surface, %."""

    cells: BaselineCellsModel
    """Cells with readings, and cells between them."""


class BaselineModel(BearingAnswer):
    """Baseline of a bearing: learned stiffness by cell of the operating-condition grid."""

    about: BaselineVersionModel
    x: BaselineDirectionModel | None
    y: BaselineDirectionModel | None

    eccentricity_width: float | None
    """Width of the cells in eccentricity ratio; null if nothing was learned."""

    oil_temperature_width_c: float | None
    """Width of the cells in oil temperature, K; null if nothing was learned."""


class RenewModel(ReasonModel):
    """Request to renew the baseline after a machine event."""

    event_time: Annotated[Moment, Field(strict=False, examples=["2026-11-21T08:00:00Z"])]
    """End of the machine event, RFC 3339 with offset; only later readings are used."""


def version_model(
    entry: BaselineEntry, versions: Versions, steps: list[StoredStep]
) -> BaselineVersionModel:
    """Return the API model of a baseline version.

    `versions` states which versions are in force and rejected after all steps; `steps` are all
    steps in the history of the baselines of the bearing.
    """
    own = [step for step in steps if step.version == entry.version]
    reasons = (step.reason for step in own if step.step is BaselineStep.LEARNED)
    return BaselineVersionModel.of(
        entry,
        status=_status(entry, versions, own),
        # the reason why it was learned, unless that is the machine event
        remark=next((words for words in reasons if words != entry.event), ""),
        is_frozen=versions.is_frozen and entry.version == versions.in_force,
    )


def _status(entry: BaselineEntry, versions: Versions, own: list[StoredStep]) -> BaselineStatusName:
    if entry.version == versions.in_force:
        return "in_force"
    if entry.version in versions.rejected:
        return "rejected"
    was_accepted = any(step.step is BaselineStep.ACCEPTED for step in own)
    is_before = versions.renewed_ns is not None and entry.learned_from_ns < versions.renewed_ns
    return "superseded" if was_accepted or is_before else "learned"


def _direction(learned: QuantityBaseline) -> BaselineDirectionModel:
    return BaselineDirectionModel.of(
        learned,
        cells=_cells(list(learned.table.cells), learned.grid),
        scatter_percent=100.0 * learned.scatter,
    )


ATTITUDE = ("attitude_low_deg", "attitude_high_deg")

CELL_FIELDS = ("eccentricity_ratio", "oil_temperature_c", "n_readings", "n_days", "support")


def _cells(cells: list[CellStatistics], grid: CellGrid) -> BaselineCellsModel:
    limits = [cell_model(cell.cell, grid) for cell in cells]
    columns = {name: [getattr(each, name) for each in limits] for name in CellModel.model_fields}
    without = {} if grid.attitude_width_deg else dict.fromkeys(ATTITUDE, None)
    ln_k = np.array([cell.location for cell in cells])
    k, of_kb = absolute_and_ratio(np.exp(ln_k), ln_k)
    return BaselineCellsModel.of(
        **columns | without,
        stiffness_n_per_m=listed(k),
        stiffness_of_kb=listed(of_kb),
        scatter_percent=[100.0 * cell.scatter for cell in cells],
        surface_std_percent=[100.0 * cell.surface_std for cell in cells],
        **{name: [getattr(cell, name) for cell in cells] for name in CELL_FIELDS},
    )


Version = Annotated[int, Path(ge=1, le=10**15, description="Version of a baseline.", examples=[3])]

ACTION_PROBLEMS = problem_responses(
    own={
        404: "Unknown unit, bearing or version",
        409: "Conflict with the present baselines, or the film is not monitored",
    }
)

CHANGE = [needs(Permission.CHANGE_MEASURING)]

EXPORTED = file_content(
    "application/json",
    "The baseline as a document.",
    {"type": "object"},
    example={"format": BASELINE, "format_version": FORMAT_VERSION, "content": {}},
)


def baseline_router(context: Context) -> GuardedRouter:
    """Return the router for baselines; each action on baselines returns the changed baselines."""
    router = subject_router("/units/{unit}/bearings/{bearing}/baselines", "baselines")

    async def done(
        unit: str, bearing: str, action: commands.BaselineAction, asked: ReasonModel
    ) -> BaselinesModel:
        """Execute an action on baselines; return the baselines after the action is stored."""
        if isinstance(action, commands.Accept | commands.Reject):
            entries = await asyncio.to_thread(context.store.films.baselines, unit, bearing)
            if action.version not in [entry.version for entry in entries]:
                raise _unknown_version(unit, bearing, action.version)
        place = watched_place(context, unit, bearing)
        await context.operators.act(place, action, actor_or(asked.actor), asked.reason)
        return await asyncio.to_thread(_baselines, context, unit, bearing)

    @router.get("", response_model=BaselinesModel)
    async def baselines(unit: UnitId, bearing: BearingId) -> Response:
        """Return all baseline versions of a bearing, their history, and progress of learning."""
        return await rendered(lambda: _baselines(context, unit, bearing))

    @router.get("/{version}", response_model=BaselineModel)
    async def one_baseline(unit: UnitId, bearing: BearingId, version: Version) -> Response:
        """Return the cells of a baseline with their bounds, stiffness and scatter."""
        return await rendered(lambda: _baseline(context, unit, bearing, version))

    @router.get("/{version}/export", responses=EXPORTED, response_class=Response)
    async def export_baseline(unit: UnitId, bearing: BearingId, version: Version) -> Response:
        """Export the complete baseline as a JSON document, which padwatch can read without loss."""
        found = await asyncio.to_thread(lambda: to_json(_stored(context, unit, bearing, version)))
        name = f"{unit}-{bearing}-baseline-{version}.json"
        headers = {"Content-Disposition": f'attachment; filename="{name}"'}
        return Response(found, headers=headers, media_type="application/json")

    @router.post("/{version}/accept", responses=ACTION_PROBLEMS, dependencies=CHANGE)
    async def accept_baseline(
        unit: UnitId, bearing: BearingId, version: Version, asked: ReasonModel
    ) -> BaselinesModel:
        """Accept a baseline version, which is in force from the next reading."""
        return await done(unit, bearing, commands.Accept(version), asked)

    @router.post("/{version}/reject", responses=ACTION_PROBLEMS, dependencies=CHANGE)
    async def reject_baseline(
        unit: UnitId, bearing: BearingId, version: Version, asked: ReasonModel
    ) -> BaselinesModel:
        """Reject a version; if it was in force, none is in force until another is accepted."""
        return await done(unit, bearing, commands.Reject(version), asked)

    @router.post("/freeze", responses=ACTION_PROBLEMS, dependencies=CHANGE)
    async def freeze_baseline(
        unit: UnitId, bearing: BearingId, asked: ReasonModel
    ) -> BaselinesModel:
        """Suspend the learning of baselines; the version in force does not change."""
        return await done(unit, bearing, commands.Freeze(), asked)

    @router.post("/thaw", responses=ACTION_PROBLEMS, dependencies=CHANGE)
    async def thaw_baseline(unit: UnitId, bearing: BearingId, asked: ReasonModel) -> BaselinesModel:
        """Resume learning after a freeze, until the end of the learning period."""
        return await done(unit, bearing, commands.Thaw(), asked)

    @router.post("/renew", responses=ACTION_PROBLEMS, dependencies=CHANGE)
    async def renew_baseline(unit: UnitId, bearing: BearingId, asked: RenewModel) -> BaselinesModel:
        """Start a new baseline after a machine event, such as an overhaul.

        No baseline is in force until enough readings after the event are learned.
        """
        from_ns = ns_from_datetime(asked.event_time, "event_time")
        if from_ns < 0:
            detail = f"event_time must not be before 1970, got {rfc3339(from_ns)}"
            raise ProblemError(422, "Wrong parameter", detail, "event_time")
        return await done(unit, bearing, commands.Renew(from_ns), asked)

    return router


def _baselines(context: Context, unit: str, bearing: str) -> BaselinesModel:
    store = context.store.films
    entries, steps = list(store.baselines(unit, bearing)), list(store.steps(unit, bearing))
    versions, place = versions_after(steps), context.films.place(unit, bearing)
    return BaselinesModel.of(
        versions,
        unit=unit,
        bearing=bearing,
        estimator=place and place.estimator,
        acceptance=context.films.settings.acceptance,
        learning=place and learning_model(context, place, versions, entries),
        versions=[version_model(entry, versions, steps) for entry in entries],
        steps=steps[::-1],
    )


def _baseline(context: Context, unit: str, bearing: str, version: int) -> BaselineModel:
    found, store = _stored(context, unit, bearing, version), context.store.films
    steps = list(store.steps(unit, bearing))
    [entry] = [one for one in store.baselines(unit, bearing) if one.version == version]
    x, y = (found.of(f"k_{direction}") for direction in ("x", "y"))
    grid = next((learned.grid for learned in (x, y) if learned), None)
    return BaselineModel.of(
        found.origin,
        about=version_model(entry, versions_after(steps), steps),
        eccentricity_width=grid and grid.eccentricity_width,
        oil_temperature_width_c=grid and grid.temperature_width_c,
        x=x and _direction(x),
        y=y and _direction(y),
    )


def _stored(context: Context, unit: str, bearing: str, version: int) -> BearingBaseline:
    found = context.store.films.baseline(unit, bearing, version)
    if found is None:
        raise _unknown_version(unit, bearing, version)
    return found


def _unknown_version(unit: str, bearing: str, version: int) -> ProblemError:
    detail = f"unit {unit!r} bearing {bearing!r} has no baseline {version}"
    return ProblemError(404, "Unknown baseline", detail)
