"""Health page of a process without an API: /livez, /readyz and /metrics."""

import asyncio
import socket
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial

from fastapi import FastAPI, Response
from fastapi.responses import JSONResponse
from prometheus_client import exposition
from prometheus_client.metrics_core import Metric

from acquisition.clock import Clock
from service.api.http.config import GuardedConfig
from service.api.http.server import GuardedServer
from service.runtime.heartbeats import Heartbeats
from service.settings.processes import HttpLimitSettings

TEXT = exposition.CONTENT_TYPE_PLAIN_0_0_4


@dataclass(frozen=True)
class Health:
    """What a process says of itself.

    Parameters
    ----------
    checks
        What is wrong with each thing that must work; None where nothing is.
    shown
        What is told beside them and makes nobody unready: a device that is away, say.
    metrics
        For Prometheus.
    """

    checks: Callable[[], Mapping[str, str | None]]
    shown: Callable[[], Mapping[str, str]]
    metrics: Callable[[], Iterable[Metric]]


@dataclass(frozen=True)
class _Families:
    """What the library takes for a registry."""

    families: Callable[[], Iterable[Metric]]

    def collect(self) -> Iterable[Metric]:
        """All families."""
        return self.families()


def health_app(health: Health) -> FastAPI:
    """The application; it answers anybody who reaches it, and tells no secrets."""
    app = FastAPI(title="padwatch", docs_url=None, redoc_url=None, openapi_url=None)

    @app.get("/livez")
    async def livez() -> JSONResponse:
        """Answer as long as the event loop turns."""
        return JSONResponse({"status": "ok", "checks": {"event_loop": "turning"}})

    @app.get("/readyz")
    async def readyz() -> JSONResponse:
        """Answer 200 if everything that must work does, 503 if not."""
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
        """Counters and gauges, for Prometheus."""
        return Response(
            exposition.generate_latest(_Families(health.metrics)), headers={"content-type": TEXT}
        )

    return app


HOST = "127.0.0.1"
"""Whoever else wants to know asks a proxy or an agent on the same computer."""


class HealthServer:
    """Serves the health page on a socket."""

    def __init__(self, health: Health, listener: socket.socket, clock: Clock) -> None:
        config = GuardedConfig(health_app(health), HttpLimitSettings(), [HOST], clock.monotonic_s)
        self._server, self._listener = GuardedServer(config), listener

    def start(self, tasks: asyncio.TaskGroup, beats: Heartbeats) -> asyncio.Task[None]:
        """Begin to serve; ends after `stop`."""
        serve = partial(self._server.run_on, self._listener)
        return tasks.create_task(beats.tend("health", serve), name="health")

    async def started(self) -> None:
        """Wait until it answers."""
        while not self._server.started:
            await asyncio.sleep(0.01)

    def stop(self) -> None:
        """Take no more requests."""
        self._server.should_exit = True
