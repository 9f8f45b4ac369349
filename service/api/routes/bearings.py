"""Routes for guide bearings: configuration, newest result, uncertainty budgets, references."""

import asyncio
from collections.abc import Mapping
from functools import partial
from typing import Annotated, Literal

from fastapi import Request, Response
from pydantic import Field

from core.machine.unit import Estimator
from core.monitor.catalogue import quantity_named, quantity_of
from core.spectra.runout import RunoutVerdict
from core.spectra.speed import SpeedSource
from core.stiffness.estimators import ESTIMATORS, reported_name
from service.api.auth.gate import GuardedRouter, actor_or, needs, subject_router
from service.api.context import BearingId, Context, QuantityName, UnitId
from service.api.problems import ProblemError, problem_responses
from service.api.values import (
    PLACES,
    ActorModel,
    ApiModel,
    BearingAnswer,
    ByName,
    NoteOrNone,
    NoteText,
    OperatingStateName,
    PlaceName,
    QualityModel,
    ReadingModel,
    Time,
    UncertaintyModel,
    WindowModel,
    reading_model,
    window_model,
)
from service.live.commands import TakeReference
from service.live.current_state import LiveUnits
from service.live.models import BudgetLineModel
from service.live.status import CurrentBearing
from service.store.access.identities import Permission
from service.store.references import GapReference

MicrometrePair = Annotated[
    list[float], Field(min_length=2, max_length=2, examples=[[1998.5, 2003.1]])
]


class ReferenceModel(ApiModel):
    """Origin of the gap reference in force: source, time and author."""

    set: Time | None
    author: str | None
    note: NoteOrNone

    source: Literal["plant_file", "given", "measured"]
    """Source: plant file, values entered by hand ("given"), or mean measured gaps ("measured")."""


PLANT_FILE = ReferenceModel(source="plant_file", set=None, author=None, note=None)
"""Origin of a gap reference from the plant file."""


class BearingModel(ApiModel):
    """Configuration of a guide bearing, with the gap reference in force."""

    unit: str
    id: str
    name: str | None
    clearance_um: float

    bracket_stiffness_n_per_m: float | None
    """Radial stiffness of the bearing bracket, N/m; null if unknown. Film coefficients are then
    reported as ratios to it."""

    gap_reference_um: MicrometrePair
    """Gap reference in force: probe gaps [x, y] with the shaft centred, µm."""

    opposite_reference_um: MicrometrePair | None
    """Gap reference of the probes across the shaft, µm; null without such probes."""

    reference: ReferenceModel
    """Origin of the gap reference in force."""

    channels: dict[str, str]
    """Identifiers of the channels, by place: shaft_x, shaft_y, bearing_x and bearing_y."""


class ResultModel(ApiModel):
    """Newest result of a bearing; if it is not current, its readings are null and give a reason."""

    bearing: str
    received: Time | None

    time: Time | None
    """End of the samples of the newest result, even if it is not current; null without a result."""

    quality: QualityModel
    """Quality of the result: the worst of its 1× amplitudes and its preferred stiffness."""

    speed_source: SpeedSource | None
    """Source of the running speed of the newest result; null without a result."""

    estimators: dict[str, Estimator | None]
    """Estimator of the preferred stiffness, by axes "xx" and "yy"; null without a stiffness."""

    readings: dict[str, ReadingModel]
    """Readings by name of the quantity in the catalogue, which gives their units."""


class LatestModel(ResultModel, BearingAnswer):
    """Newest result of a bearing with the readings of all quantities of the catalogue."""

    runout: Annotated[
        dict[str, RunoutVerdict | None],
        Field(examples=[{"shaft_x": "applied", "shaft_y": "no_vector"}]),
    ]
    """Runout compensation of 1× in the newest segment, by "shaft_x" and "shaft_y": "applied", or
    the reason why it is not applied: "no_vector" (no runout vector in the plant file),
    "other_probe" (vector measured with a probe other than the present one), "not_slow_roll" (vector
    measured above a quarter of the rated speed), "no_phase_reference" (no key-phase, or its pulses
    are missing, doubled, irregular or contradicted). Null without a current result."""

    clipped_share: Annotated[
        dict[str, float], Field(examples=[{"shaft_x": 0.0, "bearing_x": 0.0002}])
    ]
    """Fraction of the samples of the newest segment at a limit of the converter's range, by
    "shaft_x" to "bearing_y"; empty without waveforms or without a current result."""

    window: WindowModel | None
    """Averaging window of the newest result; null without a result."""


class BudgetModel(ApiModel):
    """Uncertainty budget of one result (JCGM 100:2008, "GUM")."""

    label: Annotated[str, Field(examples=["Film stiffness, broadband estimate, xx"])]
    uncertainty: UncertaintyModel

    quantity: Annotated[str, Field(examples=["dynamic_k_xx_n_per_m"])]
    """Name of the quantity in the catalogue."""

    unit: Annotated[str, Field(examples=["N/m"])]
    """Unit of the value and of the uncertainties."""

    time: Time
    """End of the samples of the result."""

    value: float
    """Value of the result."""

    lines: list[BudgetLineModel]
    """Contributions to the uncertainty, largest first."""


class SetReferenceModel(ApiModel):
    """Stored gap reference of a bearing: probe gaps with the shaft centred."""

    set: Time
    author: str
    note: NoteOrNone

    gap_reference_um: MicrometrePair
    """Probe gaps [x, y] with the shaft centred, µm."""

    opposite_reference_um: MicrometrePair | None
    """Gaps of the probes across the shaft, µm; null without such probes."""

    source: Literal["given", "measured"]
    """Source: values entered by hand ("given"), or mean measured gaps ("measured")."""


class VectorModel(ApiModel):
    """Vibration vector of 1×: amplitude and phase."""

    amplitude_um_pk: Annotated[float, Field(examples=[61.2])]
    """Amplitude, µm zero-to-peak."""

    phase_deg: Annotated[float | None, Field(examples=[134.8])]
    """Phase lead over the key-phase pulse, degrees; null without a key-phase, when only amplitudes
    are compared."""


class Order1ReferenceModel(BearingAnswer):
    """Stored 1× reference of a bearing: vibration vectors in the healthy state."""

    set: Time
    author: str
    note: NoteOrNone

    state: Annotated[OperatingStateName, ByName]
    """Operating state to which the reference applies."""

    vectors: dict[PlaceName, VectorModel]
    """Reference vectors of 1×, by channel."""


class TakeReferenceModel(ActorModel):
    """Request to store the current 1× vectors of a bearing as reference."""

    note: NoteText = ""
    """Note, at most 500 printable characters."""


def reference_model(reference: GapReference | None) -> ReferenceModel:
    """Return the API model of the origin of a gap reference.

    None means that the gap reference of the plant file is in force.
    """
    return PLANT_FILE if reference is None else ReferenceModel.of(reference)


def result_model(
    current: CurrentBearing, bearing: str, readings: Mapping[str, ReadingModel]
) -> ResultModel:
    """Return the API model of a bearing's newest result, with the given readings by quantity."""
    newest = current.assessment
    shown = newest if current.is_current else None
    return ResultModel.of(
        current,
        bearing=bearing,
        time=newest and newest.time_ns,
        speed_source=newest and newest.speed_source,
        estimators=shown.estimators if shown else {"xx": None, "yy": None},
        readings=readings,
    )


def latest_model(live: LiveUnits, unit: str, bearing: str) -> LatestModel:
    """Return the API model of the newest result; readings are null if the result is not current."""
    current = live.current(unit, bearing)
    newest = current.assessment
    shown = newest if current.is_current else None
    return LatestModel.of(
        result_model(current, bearing, {n: reading_model(r) for n, r in current.readings.items()}),
        unit=unit,
        window=newest and window_model(newest.window),
        runout=shown.runout if shown else {"shaft_x": None, "shaft_y": None},
        clipped_share=shown.clipped_share if shown else {},
    )


TAKE_PROBLEMS = problem_responses(own={409: "The present condition does not permit a reference"})


def bearing_router(context: Context) -> GuardedRouter:
    """Return the router for bearings."""
    router = subject_router("/units/{unit}/bearings", "bearing")

    @router.get("")
    async def bearings(unit: UnitId) -> list[BearingModel]:
        """List the guide bearings of a unit with their configuration and gap reference in force."""
        return [_bearing(context, unit, bearing.id) for bearing in context.units[unit].bearing]

    @router.get("/{bearing}")
    async def one_bearing(unit: UnitId, bearing: BearingId) -> BearingModel:
        """Return bracket stiffness, clearance, channels and gap reference of a bearing."""
        return _bearing(context, unit, bearing)

    @router.get("/{bearing}/latest", response_model=LatestModel)
    async def newest_result(request: Request, unit: UnitId, bearing: BearingId) -> Response:
        """Return the newest result of a bearing; readings are null if the result is not current."""
        make = partial(latest_model, context.live, unit, bearing)
        revision = partial(context.live.revision, unit)
        return await context.answers.of(request, revision, make, is_polled=True)

    @router.get(
        "/{bearing}/budgets/{quantity}",
        response_model=BudgetModel,
        responses=problem_responses(409),
    )
    async def uncertainty_budget(
        request: Request, unit: UnitId, bearing: BearingId, quantity: QuantityName
    ) -> Response:
        """Return the uncertainty budget of a quantity in the newest result."""
        known = quantity_named(quantity)
        if known is None or not known.has_uncertainty:
            detail = f"quantity {quantity!r} has no uncertainty budget; see /api/v1/quantities"
            raise ProblemError(404, "No uncertainty budget", detail)
        revision = partial(context.live.revision, unit)
        make = partial(_budget, context, unit, bearing, quantity)
        return await context.answers.of(request, revision, make)

    @router.get("/{bearing}/references")
    async def gap_references(unit: UnitId, bearing: BearingId) -> list[SetReferenceModel]:
        """List the stored gap references of a bearing, newest first, at most 1000.

        The newest reference comes into force a few seconds after it was set. Without stored
        references, the reference of the plant file applies.
        """
        history = await asyncio.to_thread(context.store.gap_references.history, unit, bearing)
        return [SetReferenceModel.of(reference) for reference in history]

    @router.get("/{bearing}/order1-references", name="references")
    async def order1_references(unit: UnitId, bearing: BearingId) -> list[Order1ReferenceModel]:
        """List the stored 1× references of a bearing, newest first, at most 1000.

        In each operating state, the newest reference of this state applies. Without stored
        references, the reference of the plant file applies.
        """
        history = await asyncio.to_thread(context.store.order1_references.history, unit, bearing)
        return [Order1ReferenceModel.of(found, found.reference) for found in history]

    @router.post(
        "/{bearing}/order1-references",
        responses=TAKE_PROBLEMS,
        dependencies=[needs(Permission.CHANGE_MEASURING)],
    )
    async def take_order1_reference(
        unit: UnitId, bearing: BearingId, asked: TakeReferenceModel
    ) -> Order1ReferenceModel:
        """Store the 1× vectors of the newest result as reference for its operating state."""
        command = TakeReference(unit, bearing, actor_or(asked.actor), asked.note)
        taken = await context.operators.take_reference(command)
        return Order1ReferenceModel.of(taken, taken.reference)

    return router


def _bearing(context: Context, unit: str, bearing: str) -> BearingModel:
    settings, in_force = context.bearing(unit, bearing), context.references.bearing(unit, bearing)
    return BearingModel.of(
        in_force,
        settings,
        unit=unit,
        reference=reference_model(context.references.of(unit, bearing)),
        channels={place: getattr(in_force, place) for place in PLACES},
    )


def _budget(context: Context, unit: str, bearing: str, quantity: str) -> BudgetModel:
    """Return the uncertainty budget of a quantity in the newest result.

    The budget of the preferred stiffness is that of its estimator. Raises a problem of status 409
    without a current result or a budget.
    """
    current = context.live.current(unit, bearing)
    assessment, source = current.assessment if current.is_current else None, quantity
    if assessment is not None and quantity.startswith("stiffness_"):
        axes = quantity.split("_")[1]
        estimator = assessment.estimators[axes]
        source = ESTIMATORS[estimator].stiffness.format(axes=axes) if estimator else quantity
    budgets = assessment.budgets if assessment else {}
    budget = budgets.get(reported_name(budgets, source))
    if assessment is None or budget is None:
        detail = f"{quantity} has no uncertainty budget: no value or too few segments"
        raise ProblemError(409, "No result", detail)
    quantity, (low, high) = reported_name(assessment.readings, quantity), budget.interval
    lines = sorted(budget.lines, key=lambda line: line.contribution, reverse=True)
    return BudgetModel.of(
        budget,
        quantity_of(quantity),
        quantity=quantity,
        time=assessment.time_ns,
        uncertainty=UncertaintyModel.of(budget, low_95=low, high_95=high),
        lines=lines,
    )
