"""The health of each source."""

from fastapi import APIRouter

from service.api.auth.declared import needs
from service.api.context import Context
from service.api.source_models import PollsModel, SourceHealthModel
from service.api.views import source_model
from service.runtime.metrics import Seen
from service.settings.units import UnitSettings
from service.store.access.identities import Permission


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
    arriving, source = source_model(context.live, settings.id), context.sources.get(settings.id)
    return SourceHealthModel(
        **arriving.model_dump(),
        unit=settings.id,
        kind=settings.source.kind,
        n_failed=context.live.status(settings.id).n_failed,
        rate_hz=settings.sampling_hz,
        poll_period_s=getattr(settings.source, "poll_period_s", None),
        polls=None if source is None else _polls(source.polls.seen()),
        refused_frames={} if source is None else dict(source.refused_frames),
    )


def _polls(seen: Seen) -> PollsModel | None:
    if seen.newest_s is None:
        return None
    n_polls = seen.n_up_to[-1]
    return PollsModel(n=n_polls, newest_s=seen.newest_s, mean_s=seen.sum_s / n_polls)
