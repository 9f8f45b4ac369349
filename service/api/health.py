"""Routes for liveness, readiness and metrics of the service, and the metrics of requests."""

import time
from typing import Literal

from fastapi import Response
from prometheus_client import CollectorRegistry, Histogram
from prometheus_client.exposition import generate_latest
from prometheus_client.process_collector import ProcessCollector
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.auth.gate import OPEN, GuardedRouter, needs
from service.api.context import Context
from service.api.downloads import file_content
from service.api.values import ApiModel
from service.runtime.metrics import TEXT
from service.store.access.identities import Permission

NO_ROUTE = "unknown"
"""Label of requests for addresses that do not exist; their paths would be labels without limit."""


class RequestMetrics:
    """Histogram of the durations of requests, and the metrics of the process."""

    def __init__(self) -> None:
        self._registry = CollectorRegistry()
        self._durations = Histogram(
            "padwatch_http_request_duration_seconds",
            "This is the time from a request until its answer was sent.",
            ["route", "status"],
            registry=self._registry,
        )
        ProcessCollector(namespace="padwatch_serving", registry=self._registry)

    def observe(self, route: str, status: int, duration_s: float) -> None:
        """Add the duration of an answered request, s, to the histogram of its route and status."""
        self._durations.labels(route, str(status)).observe(duration_s)

    def timed(self, app: ASGIApp) -> ASGIApp:
        """Return ASGI middleware around `app` that measures the duration of answered requests."""

        async def middleware(scope: Scope, receive: Receive, send: Send) -> None:
            began_s, status = time.perf_counter(), 0

            async def noting(message: Message) -> None:
                nonlocal status
                status = message.get("status", status)
                await send(message)

            await app(scope, receive, noting)
            if status:
                route = getattr(scope.get("route"), "path", NO_ROUTE)
                self.observe(route, status, time.perf_counter() - began_s)

        return middleware

    @property
    def text(self) -> bytes:
        """Metrics of requests and of this process in the Prometheus text format 0.0.4."""
        return generate_latest(self._registry)


class HealthModel(ApiModel):
    """Result of the health checks of the service."""

    status: Literal["ok", "not ready"]
    """Overall result of the checks."""

    checks: dict[str, str]
    """Result of each check in words, by name of the check."""


EXAMPLE = """\
# HELP padwatch_link_connected This is 1 while the device of the unit is connected.
# TYPE padwatch_link_connected gauge
padwatch_link_connected{unit="U1"} 1.0
"""

WORDS = "Metrics in the Prometheus text format"


def health_router(context: Context, requests: RequestMetrics) -> GuardedRouter:
    """Return the router for liveness and readiness, and for metrics if the context has them.

    `requests` are the metrics of this process, appended to those of the measuring process.
    """
    router = GuardedRouter(tags=["health"])

    @router.get("/livez", dependencies=[OPEN])
    async def liveness() -> HealthModel:
        """Answer 200 while the event loop runs, independent of data acquisition and disk."""
        return HealthModel(status="ok", checks={"event_loop": "turning"})

    @router.get(
        "/readyz",
        dependencies=[OPEN],
        responses={503: {"model": HealthModel, "description": "At least one check fails"}},
    )
    async def readiness(response: Response) -> HealthModel:
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

    look = context.metrics
    if look is None:
        return router

    @router.get(
        "/metrics",
        dependencies=[needs(Permission.READ)],
        response_class=Response,
        responses=file_content("text/plain", WORDS, {"type": "string"}, example=EXAMPLE),
    )
    async def prometheus_metrics() -> Response:
        """Return metrics of samples, links, results, films, alarms, store, deliveries, requests."""
        headers = {"content-type": TEXT, "cache-control": "no-store"}
        return Response(await look() + requests.text, headers=headers)

    return router
