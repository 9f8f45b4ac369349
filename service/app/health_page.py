"""Health page of a process without an API: /livez, /readyz and /metrics."""

import socket
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from types import SimpleNamespace

from fastapi import FastAPI, Response
from fastapi.responses import JSONResponse
from prometheus_client import exposition
from prometheus_client.metrics_core import Metric

from acquisition.clock import Clock
from service.api.http.protocol import GuardedConfig
from service.api.http.server import GuardedServer
from service.app.process import ProcessServer
from service.settings.processes import HttpLimitSettings

TEXT = exposition.CONTENT_TYPE_PLAIN_0_0_4


@dataclass(frozen=True)
class Health:
    """Contents of the health page of a process.

    Parameters
    ----------
    checks
        Fault of each required part by name; None for a working part.
    shown
        Status texts by name that do not affect readiness, such as a disconnected device.
    metrics
        Returns the metric families for Prometheus.
    """

    checks: Callable[[], Mapping[str, str | None]]
    shown: Callable[[], Mapping[str, str]]
    metrics: Callable[[], Iterable[Metric]]


def health_app(health: Health) -> FastAPI:
    """Return the ASGI application of the health page; no login, no secrets."""
    app = FastAPI(title="padwatch", docs_url=None, redoc_url=None, openapi_url=None)

    @app.get("/livez")
    async def livez() -> JSONResponse:
        """Return 200 while the event loop runs."""
        return JSONResponse({"status": "ok", "checks": {"event_loop": "turning"}})

    @app.get("/readyz")
    async def readyz() -> JSONResponse:
        """Return 200 if all required parts work, 503 otherwise."""
        checks = health.checks()
        is_ready = not any(checks.values())
        words = {name: trouble or "ok" for name, trouble in checks.items()}
        body = {
            "status": "ok" if is_ready else "not ready",
            "checks": {**health.shown(), **words},
        }
        return JSONResponse(body, 200 if is_ready else 503)

    @app.get("/metrics")
    async def metrics() -> Response:
        """Return the metrics in the text format of Prometheus."""
        families = SimpleNamespace(collect=health.metrics)  # instead of a registry
        return Response(exposition.generate_latest(families), headers={"content-type": TEXT})

    return app


HOST = "127.0.0.1"
"""Host of the health page: loopback only; other hosts need a proxy or an agent on this host."""


def health_server(
    health: Health, listener: socket.socket, clock: Clock, announce: Callable[[str], None]
) -> ProcessServer:
    """Return the server of the health page on a socket."""
    config = GuardedConfig(health_app(health), HttpLimitSettings(), [HOST], clock.monotonic_s)
    return ProcessServer("health", GuardedServer(config), listener, announce)
