"""Health page of a process without an API: /livez, /readyz and /metrics."""

import asyncio
import json
import socket
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from service.runtime.heartbeats import Pulse
from service.runtime.metrics import TEXT

HOST = "127.0.0.1"
"""Host of the health page: loopback only; other hosts need a proxy or an agent on this host."""

ANSWERS_WITHIN_S = 5.0
"""Maximum time for a request, and for an answer of the event loop, s."""


@dataclass(frozen=True)
class Health:
    """Contents of the health page of a process.

    Parameters
    ----------
    checks
        Function that returns, by name of each required part, its fault; None if the part works.
    shown
        Function that returns further status texts by name, which do not affect readiness.
    metrics
        Function that returns the metrics in the Prometheus text format.
    """

    checks: Callable[[], Mapping[str, str | None]]
    shown: Callable[[], Mapping[str, str]]
    metrics: Callable[[], bytes]

    async def page(self, path: str) -> tuple[int, str, bytes]:
        """Return the HTTP status, content type and content of the page at a URL path."""
        if path == "/metrics":
            return 200, TEXT, self.metrics()
        if path == "/livez":
            return _document(200, {"event_loop": "turning"})
        if path != "/readyz":
            return 404, "text/plain", b"pages: /livez, /readyz, /metrics\n"
        checks = self.checks()
        words = {name: trouble or "ok" for name, trouble in checks.items()}
        return _document(503 if any(checks.values()) else 200, {**self.shown(), **words})


def _document(status: int, checks: Mapping[str, str]) -> tuple[int, str, bytes]:
    body = {"status": "ok" if status == 200 else "not ready", "checks": checks}
    return status, "application/json", json.dumps(body).encode()


class HealthServer:
    """HTTP server of the health page; it runs in threads and gets the pages from the event loop."""

    def __init__(self, health: Health, listener: socket.socket) -> None:
        self._health, self._listener = health, listener

    async def run(self, pulse: Pulse) -> None:
        """Serve the page until cancelled; `pulse` gets heartbeats.

        Takes over the listening socket and closes it at the end; call it once.
        """
        pulse.rest()
        loop = asyncio.get_running_loop()

        def page(path: str) -> tuple[int, str, bytes]:
            making = asyncio.run_coroutine_threadsafe(self._health.page(path), loop)
            return making.result(ANSWERS_WITHIN_S)

        with ThreadingHTTPServer((HOST, 0), handler_of(page), bind_and_activate=False) as server:
            server.socket.close()
            server.socket = self._listener
            serving = asyncio.create_task(asyncio.to_thread(server.serve_forever, 0.1))
            try:
                await asyncio.shield(serving)
            finally:
                await asyncio.to_thread(server.shutdown)


def handler_of(page: Callable[[str], tuple[int, str, bytes]]) -> type[BaseHTTPRequestHandler]:
    """Return a request handler; `page` maps a path to status, content type and content."""

    class Handler(BaseHTTPRequestHandler):
        timeout = ANSWERS_WITHIN_S
        server_version, sys_version = "padwatch", ""

        def do_GET(self) -> None:
            try:
                status, kind, content = page(self.path.partition("?")[0])
            except TimeoutError:
                status, kind, content = 503, "text/plain", b"the event loop does not answer\n"
            self.send_response(HTTPStatus(status))
            self.send_header("content-type", kind)
            self.send_header("content-length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002
            """Log nothing: probes ask every few seconds."""

    return Handler
