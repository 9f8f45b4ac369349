"""`GET /metrics`, for Prometheus."""

from collections.abc import Awaitable, Callable
from typing import Annotated

from fastapi import APIRouter, Header, Response
from prometheus_client.registry import Collector

from service.api.auth.declared import needs
from service.runtime.metrics import OPEN_METRICS, rendered
from service.store.access.identities import Permission

EXAMPLE = """\
# HELP padwatch_link_connected 1 while the device is connected.
# TYPE padwatch_link_connected gauge
padwatch_link_connected{unit="U1"} 1.0
"""

ANSWER = {
    "description": "Metrics in Prometheus' text format, or in OpenMetrics' where that is accepted",
    "content": {
        kind: {"schema": {"type": "string"}, "example": EXAMPLE}
        for kind in ("text/plain", OPEN_METRICS.partition(";")[0])
    },
}


def metrics_router(look: Callable[[], Awaitable[Collector]]) -> APIRouter:
    """The route that Prometheus asks.

    Parameters
    ----------
    look
        All metrics as they are now.
    """
    router = APIRouter(tags=["health"], dependencies=[needs(Permission.READ)])

    @router.get(
        "/metrics",
        summary="How the service does, for Prometheus",
        response_class=Response,
        responses={200: ANSWER},
    )
    async def metrics(
        accept: Annotated[
            str, Header(description="Formats that are taken.", examples=["text/plain"])
        ] = "text/plain",
    ) -> Response:
        """Samples, links, results, alarms, store and deliveries as counters and gauges."""
        body, kind = rendered(await look(), accept)
        return Response(body, headers={"content-type": kind, "cache-control": "no-store"})

    return router
