"""The health of each source."""

from fastapi import APIRouter

from service.api.access.declared import needs
from service.api.context import Context
from service.api.source_models import SourceHealthModel
from service.api.views import source_model
from service.security.roles import Permission
from service.settings.units import UnitSettings


def source_router(context: Context) -> APIRouter:
    """The route about sources."""
    router = APIRouter(
        prefix="/api/v1/sources", tags=["plant"], dependencies=[needs(Permission.READ)]
    )

    @router.get("", summary="Health of each source")
    async def sources() -> list[SourceHealthModel]:
        """State, since when and why, failed attempts, samples by fate, and the device's clock."""
        return [_health(context, unit) for unit in context.units.values()]

    return router


def _health(context: Context, settings: UnitSettings) -> SourceHealthModel:
    arriving = source_model(context.live, settings.id)
    return SourceHealthModel(
        **arriving.model_dump(),
        unit=settings.id,
        kind=settings.source.kind,
        n_failed=context.live.status(settings.id).n_failed,
        rate_hz=settings.sampling_hz,
        poll_period_s=getattr(settings.source, "poll_period_s", None),
    )
