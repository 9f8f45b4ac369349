"""The plant, its units and the catalogue of quantities."""

from fastapi import APIRouter, Request, Response

from core.monitor.catalogue import CATALOGUE
from service.api.auth.declared import Reach, needs
from service.api.context import Context, UnitId
from service.api.overview import Overview
from service.api.plant_models import OverviewModel, QuantityModel, UnitModel
from service.api.problems import problem_responses
from service.api.views import source_model
from service.store.access.identities import Permission


def plant_router(context: Context) -> APIRouter:
    """Routes that are not about one bearing."""
    router = APIRouter(prefix="/api/v1", tags=["plant"], dependencies=[needs(Permission.READ)])
    shown = Overview(context)

    @router.get("/overview", summary="Everything at a glance", response_model=OverviewModel)
    async def overview(request: Request) -> Response:
        """All units with all bearings as they may be shown now."""
        return await shown.answer(request.headers.get("if-none-match"))

    @router.get("/units", summary="All units")
    async def units() -> list[UnitModel]:
        """All units and how their samples arrive."""
        return [_unit(context, unit) for unit in context.units]

    @router.get("/units/{unit}", summary="One unit", responses=problem_responses(404))
    async def one_unit(unit: UnitId) -> UnitModel:
        """A unit and how its samples arrive."""
        return _unit(context, context.unit(unit).id)

    @router.get(
        "/quantities",
        summary="The catalogue of quantities",
        dependencies=[needs(Permission.READ, Reach.NO_UNIT)],
    )
    async def quantities() -> list[QuantityModel]:
        """Name, unit and meaning of everything that is reported about a bearing."""
        return [QuantityModel(name=q.name, unit=q.unit, label=q.label) for q in CATALOGUE]

    return router


def _unit(context: Context, unit: str) -> UnitModel:
    settings = context.units[unit]
    return UnitModel(
        id=unit,
        name=settings.name,
        rated_speed_rpm=settings.rated_speed_rpm,
        bearing_ids=[bearing.id for bearing in settings.bearing],
        source=source_model(context.live, unit),
    )
