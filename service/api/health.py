"""Routes for liveness, readiness and metrics of the service."""

from collections.abc import Awaitable, Callable
from typing import Literal

from fastapi import APIRouter, Response

from service.api.auth.declared import OPEN, needs
from service.api.context import Context
from service.api.request_metrics import RequestMetrics
from service.api.values import ApiModel
from service.runtime.metrics import TEXT
from service.store.access.identities import Permission


class HealthModel(ApiModel):
    """Result of the health checks of the service."""

    status: Literal["ok", "not ready"]
    """Overall result of the checks."""

    checks: dict[str, str]
    """Result of each check in words, by name of the check."""


def health_router(context: Context) -> APIRouter:
    """Return the router for liveness and readiness."""
    router = APIRouter(tags=["health"], dependencies=[OPEN])

    @router.get("/livez", summary="Liveness")
    async def livez() -> HealthModel:
        """Answer 200 while the event loop runs, independent of data acquisition and disk."""
        return HealthModel(status="ok", checks={"event_loop": "turning"})

    @router.get(
        "/readyz",
        summary="Readiness",
        responses={503: {"model": HealthModel, "description": "At least one check fails"}},
    )
    async def readyz(response: Response) -> HealthModel:
        """Answer 200 if results can be stored and every background loop runs, else 503.

        Lost links to data acquisition devices are reported, but the service remains ready.
        """
        checks = {f"unit {unit}": context.live.status(unit).state.value for unit in context.units}
        checks["store"] = context.live.store_error or "ok"
        checks["database"] = context.store.kind
        plant = context.plant()
        checks |= {**plant.checks, **context.checks()}
        loops = {**plant.loops, **context.loops()}
        checks |= {f"loop {name}": trouble or "alive" for name, trouble in loops.items()}
        ready = context.live.store_error is None and not any(loops.values())
        response.status_code = 200 if ready else 503
        return HealthModel(status="ok" if ready else "not ready", checks=checks)

    return router


EXAMPLE = """\
# HELP padwatch_link_connected This is 1 while the device of the unit is connected.
# TYPE padwatch_link_connected gauge
padwatch_link_connected{unit="U1"} 1.0
"""

ANSWER = {
    "description": "Metrics in the Prometheus text format",
    "content": {"text/plain": {"schema": {"type": "string"}, "example": EXAMPLE}},
}


def metrics_router(look: Callable[[], Awaitable[bytes]], own: RequestMetrics) -> APIRouter:
    """Return the router for Prometheus metrics.

    Parameters
    ----------
    look
        Function that returns the metrics of measuring in the Prometheus text format.
    own
        Metrics of this process, which are appended.
    """
    router = APIRouter(tags=["health"], dependencies=[needs(Permission.READ)])

    @router.get(
        "/metrics",
        summary="Metrics for Prometheus",
        response_class=Response,
        responses={200: ANSWER},
    )
    async def metrics() -> Response:
        """Return metrics of samples, links, results, films, alarms, store, deliveries, requests."""
        headers = {"content-type": TEXT, "cache-control": "no-store"}
        return Response(await look() + own.text, headers=headers)

    return router
