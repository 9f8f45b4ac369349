"""Health page of a process without an API: /livez, /readyz and /metrics."""

import asyncio
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from prometheus_client.process_collector import ProcessCollector

from service.app.process import Supervision
from service.runtime.heartbeats import Pulse
from service.runtime.listening import url_of
from service.runtime.metrics import TEXT, Families

HOST = "127.0.0.1"
"""Host of the health page: loopback only; other hosts need a proxy or an agent on this host."""

ANSWERS_WITHIN_S = 5.0
"""Maximum time for a request, and for an answer of the event loop, s."""


@dataclass(frozen=True)
class HealthServer:
    """HTTP server of the health page; it runs in threads and gets the pages from the event loop.

    Parameters
    ----------
    supervision
        Supervisor of the process, with the listening socket of the page.
    checks
        Function that returns, by name of each required part, its fault; None if the part works.
    fill
        Function that adds the metrics of the process to its argument.
    shown
        Function that returns further status texts by name, which do not affect readiness.
    """

    supervision: Supervision
    checks: Callable[[], Mapping[str, str | None]]
    fill: Callable[[Families], None]
    shown: Callable[[], Mapping[str, str]] = dict

    async def page(self, path: str) -> tuple[int, str, bytes]:
        """Return the HTTP status, content type and content of the page at a URL path."""
        status, shown, process = 200, {"event_loop": "turning"}, self.supervision
        if path == "/metrics":
            families = Families()
            self.fill(families)
            families.include(ProcessCollector(registry=None))
            return 200, TEXT, families.text
        if path == "/readyz":
            loops = {f"loop {name}": trouble for name, trouble in process.beats.look().items()}
            checks = {**self.checks(), **loops}
            status = 503 if any(checks.values()) else 200
            shown = {f"unit {unit}": process.status(unit).state.value for unit in process.units}
            shown |= self.shown()
            shown |= {name: trouble or "ok" for name, trouble in checks.items()}
        elif path != "/livez":
            return 404, "text/plain", b"pages: /livez, /readyz, /metrics\n"
        body = {"status": "ok" if status == 200 else "not ready", "checks": shown}
        return status, "application/json", json.dumps(body).encode()

    async def run(self, pulse: Pulse) -> None:
        """Serve and announce the page until cancelled; `pulse` gets heartbeats.

        Takes over the listening socket and closes it at the end; call it once.
        """
        pulse.rest()
        health, loop = self, asyncio.get_running_loop()

        class Handler(BaseHTTPRequestHandler):
            timeout = ANSWERS_WITHIN_S
            server_version, sys_version = "padwatch", ""

            def do_GET(self) -> None:
                path = self.path.partition("?")[0]
                making = asyncio.run_coroutine_threadsafe(health.page(path), loop)
                try:
                    status, kind, content = making.result(ANSWERS_WITHIN_S)
                except TimeoutError:
                    status, kind = 503, "text/plain"
                    content = b"the event loop does not answer\n"
                self.send_response(HTTPStatus(status))
                self.send_header("content-type", kind)
                self.send_header("content-length", str(len(content)))
                self.end_headers()
                self.wfile.write(content)

            def log_message(self, format: str, *args: object) -> None:  # noqa: A002
                """Log nothing: probes ask every few seconds."""

        with ThreadingHTTPServer((HOST, 0), Handler, bind_and_activate=False) as server:
            server.socket.close()
            server.socket = self.supervision.host.listener
            serving = asyncio.create_task(asyncio.to_thread(server.serve_forever, 0.1))
            self.supervision.announce(url_of(server.socket))
            try:
                await asyncio.shield(serving)
            finally:
                await asyncio.to_thread(server.shutdown)
