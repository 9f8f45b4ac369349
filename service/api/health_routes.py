"""Liveness and readiness for supervisors."""

from fastapi import APIRouter, Response

from service.api.auth.declared import OPEN
from service.api.context import Context
from service.api.plant_models import HealthModel


def health_router(context: Context) -> APIRouter:
    """Liveness and readiness, for supervisors."""
    router = APIRouter(tags=["health"], dependencies=[OPEN])

    @router.get("/livez", summary="Is the process alive?")
    async def livez() -> HealthModel:
        """Answer as long as the event loop turns; a dead DAQ or disk does not matter here."""
        return HealthModel(status="ok", checks={"event_loop": "turning"})

    @router.get(
        "/readyz",
        summary="Can it do its work?",
        responses={503: {"model": HealthModel, "description": "Something does not work"}},
    )
    async def readyz(response: Response) -> HealthModel:
        """Answer 200 if results can be stored and every loop of the program is alive, 503 if not.

        A DAQ that is away is a plant's fault: it is named, but does not make the service unready.
        """
        checks = {f"unit {unit}": context.live.status(unit).state.value for unit in context.units}
        checks["store"] = context.live.store_error or "ok"
        checks["database"] = context.store.kind
        if context.space is not None:
            checks["disk"] = str(context.space)
        checks["stored data"] = context.stored_trouble() or "ok"
        checks |= context.checks()
        loops = context.loops()
        checks |= {f"loop {name}": trouble or "alive" for name, trouble in loops.items()}
        ready = context.live.store_error is None and not any(loops.values())
        response.status_code = 200 if ready else 503
        return HealthModel(status="ok" if ready else "not ready", checks=checks)

    return router
