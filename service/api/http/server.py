"""HTTP server: uvicorn, configured through its public options."""

import socket
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from ssl import SSLContext
from typing import Any, cast

import uvicorn
from starlette.types import ASGIApp

from service.api.http.middleware import SECURITY_HEADERS, AddedHeaders, CheckedRequests
from service.runtime.heartbeats import UNHEARD, Pulse
from service.settings.processes import HttpLimitSettings

BEAT_S = 1
"""Period of the heartbeats, s."""

KEEP_ALIVE_S = 10
"""Time after an answer after which an idle connection is closed, s; longer than in the shipped
nginx configuration, so that the proxy closes first."""

STOP_S = 1
"""Time for unfinished requests when the server stops, s."""


class HttpServer(uvicorn.Server):
    """Uvicorn server that sends heartbeats and leaves signals to the program."""

    async def run_on(self, listener: socket.socket, pulse: Pulse = UNHEARD) -> None:
        """Serve requests on a listening socket until stopped; send heartbeats to `pulse`."""

        async def beat() -> None:
            pulse.beat(BEAT_S)

        self.config.callback_notify = beat
        await self.serve([listener])

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Install no signal handlers; the program handles signals and stops all its parts."""
        yield


def http_server(
    app: ASGIApp,
    limits: HttpLimitSettings,
    hosts: Iterable[str],
    headers: Sequence[tuple[str, str]] = (),
    tls: SSLContext | None = None,
    around: Callable[[ASGIApp, Sequence[tuple[str, str]]], ASGIApp] = lambda app, _: app,
) -> HttpServer:
    """Return an HTTP server for an ASGI application.

    Parameters
    ----------
    app, limits
        Application to serve, and limits of connections and of the answer time.
    hosts
        Accepted host names and addresses, in addition to loopback.
    headers
        Headers of all answers, in addition to `SECURITY_HEADERS`.
    tls
        TLS context; None for plain HTTP.
    around
        Function that wraps the application in further middleware; it is called with the application
        and with the complete list of headers.
    """
    checked, added = CheckedRequests(app, hosts, limits.answer_s), [*SECURITY_HEADERS, *headers]
    complete = around(AddedHeaders(checked, added), added)
    return HttpServer(
        uvicorn.Config(
            cast(Any, complete),  # Starlette and uvicorn declare different types
            http="httptools",
            ws="none",
            lifespan="off",
            log_level="error",  # a warning for each malformed request would fill the disk
            access_log=False,
            server_header=False,
            proxy_headers=False,  # see TrustedProxy
            limit_concurrency=limits.max_connections,
            timeout_keep_alive=KEEP_ALIVE_S,
            timeout_graceful_shutdown=STOP_S,
            timeout_notify=BEAT_S,
            ssl_context_factory=None if tls is None else lambda *_: tls,
        )
    )
