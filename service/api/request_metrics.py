"""Metrics of the serving process: requests by route and status, processor time and memory."""

import time
from collections.abc import Callable

from prometheus_client import CollectorRegistry, Histogram
from prometheus_client.exposition import generate_latest
from prometheus_client.process_collector import ProcessCollector
from starlette.types import ASGIApp, Message, Receive, Scope, Send

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

    @property
    def text(self) -> bytes:
        """Metrics of requests and of this process in the Prometheus text format 0.0.4."""
        return generate_latest(self._registry)


class TimedRequests:
    """ASGI middleware that measures the duration of each answered request."""

    def __init__(
        self,
        app: ASGIApp,
        metrics: RequestMetrics,
        now_s: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._app, self._metrics, self._now_s = app, metrics, now_s

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request and measure the time until its answer was sent."""
        began_s, status = self._now_s(), 0

        async def noting(message: Message) -> None:
            nonlocal status
            status = message.get("status", status)
            await send(message)

        await self._app(scope, receive, noting)
        if status:
            route = getattr(scope.get("route"), "path", NO_ROUTE)
            self._metrics.observe(route, status, self._now_s() - began_s)
