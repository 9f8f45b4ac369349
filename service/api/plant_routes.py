"""The plant, its units and the catalogue of quantities."""

from fastapi import APIRouter

from core.quantities import CATALOGUE
from service.api.alarm_views import alarm_count_model
from service.api.context import Context, UnitId
from service.api.film_views import film_brief
from service.api.plant_models import (
    CapturesModel,
    EvidenceStatusModel,
    OverviewModel,
    PlantModel,
    QuantityModel,
    StoreModel,
    UnitModel,
    UnitOverviewModel,
)
from service.api.problems import problem_responses
from service.api.times import rfc3339
from service.api.views import latest_model, source_model


def plant_router(context: Context) -> APIRouter:
    """Routes that are not about one bearing."""
    router = APIRouter(prefix="/api/v1", tags=["plant"])

    @router.get("/overview", summary="Everything at a glance")
    async def overview() -> OverviewModel:
        """All units with all bearings as they may be shown now."""
        return OverviewModel(
            plant=PlantModel(name=context.plant_name, origin=context.origin.value),
            time=rfc3339(context.clock.now_ns()),
            refresh_s=context.refresh_s,
            store=StoreModel(error=context.live.store_error, n_unstored=context.live.n_unstored),
            alarms=alarm_count_model(context.alarms),
            captures=CapturesModel(
                error=context.captures.error,
                n_running=context.captures.n_running,
                n_written=context.captures.n_written,
            ),
            evidence=_evidence(context),
            units=[_unit_overview(context, unit) for unit in context.units],
        )

    @router.get("/units", summary="All units")
    async def units() -> list[UnitModel]:
        """All units and how their samples arrive."""
        return [_unit(context, unit) for unit in context.units]

    @router.get("/units/{unit}", summary="One unit", responses=problem_responses(404))
    async def one_unit(unit: UnitId) -> UnitModel:
        """A unit and how its samples arrive."""
        return _unit(context, context.unit(unit).id)

    @router.get("/quantities", summary="The catalogue of quantities")
    async def quantities() -> list[QuantityModel]:
        """Name, unit and meaning of everything that is reported about a bearing."""
        return [QuantityModel(name=q.name, unit=q.unit, label=q.label) for q in CATALOGUE]

    return router


def _evidence(context: Context) -> EvidenceStatusModel | None:
    if context.evidence is None:
        return None
    keeper = context.evidence.keeper
    return EvidenceStatusModel(
        error=keeper.error,
        n_waiting=keeper.n_pending,
        n_written=keeper.n_written,
        n_lost=keeper.n_lost,
    )


def _unit(context: Context, unit: str) -> UnitModel:
    settings = context.units[unit]
    return UnitModel(
        id=unit,
        name=settings.name,
        rated_speed_rpm=settings.rated_speed_rpm,
        bearing_ids=[bearing.id for bearing in settings.bearing],
        source=source_model(context.live, unit),
    )


def _unit_overview(context: Context, unit: str) -> UnitOverviewModel:
    settings = context.units[unit]
    return UnitOverviewModel(
        id=unit,
        name=settings.name,
        rated_speed_rpm=settings.rated_speed_rpm,
        source=source_model(context.live, unit),
        bearings=[latest_model(context.live, unit, bearing.id) for bearing in settings.bearing],
        films=[film_brief(context, unit, bearing.id) for bearing in settings.bearing],
    )
