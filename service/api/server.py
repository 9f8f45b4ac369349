"""HTTP server: uvicorn through its public options, with middleware for hosts, sizes and times."""

import asyncio
import re
import socket
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from ipaddress import ip_address
from ssl import SSLContext
from typing import Any, cast

import uvicorn
from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.problems import ProblemError, problem_answer
from service.runtime.asker import ASKER, Asker
from service.runtime.heartbeats import UNHEARD, Pulse
from service.settings.processes import HttpLimitSettings

SECURITY_HEADERS = (
    ("x-content-type-options", "nosniff"),
    ("referrer-policy", "no-referrer"),
    ("cross-origin-opener-policy", "same-origin"),
    ("cross-origin-resource-policy", "same-origin"),
    ("permissions-policy", "camera=(), geolocation=(), microphone=(), payment=(), usb=()"),
    ("content-security-policy", "default-src 'none'; base-uri 'none'; frame-ancestors 'none'"),
    ("cache-control", "no-store"),
)
"""Security headers of all answers; dashboard and evidence report override some of them."""


class AddedHeaders:
    """ASGI middleware that adds headers to answers, unless an answer has the header already."""

    def __init__(self, app: ASGIApp, headers: Sequence[tuple[str, str]]) -> None:
        self._app, self._headers = app, headers

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request and add headers to the answer."""

        async def completed(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in self._headers:
                    headers.setdefault(name, value)
            await send(message)

        await self._app(scope, receive, completed)


class TrustedProxy:
    """ASGI middleware that takes client address and scheme from the headers of a trusted proxy.

    The proxy adds the last value of a header. Uvicorn takes the first, which the client may have
    sent, and accepts any text as an address.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request with the client and scheme reported by the proxy."""
        scope["client"] = None
        with suppress(ValueError):
            scope["client"] = str(ip_address(_last(scope, "x-forwarded-for"))), 0
        is_https = _last(scope, "x-forwarded-proto").lower() == "https"
        scope["scheme"] = "https" if is_https else "http"
        await self._app(scope, receive, send)


def _last(scope: Scope, name: str) -> str:
    """Return the last value of a list header, which the proxy added; empty without the header."""
    return ",".join(Headers(scope=scope).getlist(name)).rpartition(",")[2].strip()


HOST = re.compile(r"(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+)(?::[0-9]{1,5})?")
"""Pattern of a Host header: name, IPv4 address or bracketed IPv6 address, and optional port."""

LOOPBACK = ("localhost", "127.0.0.1", "::1")

MAX_BODY_BYTES = 16 * 1024
"""Maximum size of a request body, bytes. Valid bodies are smaller, and 16 kB of unknown members
take 1 ms to refuse."""


class CheckedRequests:
    """ASGI middleware that refuses foreign hosts and large bodies, and ends late answers.

    The check of the Host header prevents DNS rebinding, by which another site resolves its own host
    name to 127.0.0.1. HEAD is handled as GET; the server omits the body of the answer.

    Parameters
    ----------
    hosts
        Accepted host names and addresses without port, in addition to loopback and the address of
        the server.
    answer_s
        Time from the head of the request to the start of its answer, s.
    """

    def __init__(self, app: ASGIApp, hosts: Iterable[str], answer_s: float) -> None:
        self._app, self._answer_s = app, answer_s
        self._hosts = {host.lower().strip("[]").rstrip(".") for host in (*LOOPBACK, *hosts)}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request, or answer with a problem document."""
        if scope["method"] == "HEAD":
            scope = {**scope, "method": "GET"}
        has_begun, refusal = False, None

        async def watched(message: Message) -> None:
            nonlocal has_begun
            if deadline.expired():
                return  # sent while the application is cancelled
            if not has_begun:
                has_begun = True
                deadline.reschedule(None)
            await send(message)

        asker = Asker()
        before = ASKER.set(asker)
        try:
            self._require_known_host(scope)
            _require_small_body(scope)
            async with asyncio.timeout(self._answer_s) as deadline:
                await self._app(scope, _limited(receive), watched)
        except ProblemError as error:
            refusal = error
        except TimeoutError:
            if not deadline.expired():
                raise
            refusal = _too_late("the request timed out; request a shorter range")
        except asyncio.CancelledError:
            refusal = _too_late("the service is stopping")  # cancelled by the server only
        finally:
            asker.leave()  # cancels store reads that still run in a thread
            ASKER.reset(before)
        if refusal is not None and not has_begun:
            await problem_answer(Request(scope), refusal)(scope, receive, send)

    def _require_known_host(self, scope: Scope) -> None:
        hosts = [value for name, value in scope["headers"] if name == b"host"]
        if len(hosts) != 1 or not hosts[0]:
            raise ProblemError(400, "No host", "a request must have exactly one Host header")
        found = HOST.fullmatch(hosts[0].decode("latin-1"))
        name = found[1].strip("[]").rstrip(".").lower() if found else ""
        address, _ = scope.get("server") or ("", None)
        if not name or (name not in self._hosts and name != address.removeprefix("::ffff:")):
            detail = "the requested host is not a name of this service; add it to service.hosts"
            raise ProblemError(421, "Wrong host", detail)


TOO_LARGE = f"the body must not be larger than {MAX_BODY_BYTES // 1024} KiB"


def _require_small_body(scope: Scope) -> None:
    # the server accepts digits only; int() is slow for very many
    lengths = [value for name, value in scope["headers"] if name == b"content-length"]
    if any(len(value) > 18 or int(value) > MAX_BODY_BYTES for value in lengths):
        raise ProblemError(413, "Body too large", TOO_LARGE)


def _limited(receive: Receive) -> Receive:
    """Return a `receive` function that raises HTTPException above the maximum body size."""
    n_bytes = 0

    async def limited() -> Message:
        nonlocal n_bytes
        message = await receive()
        n_bytes += len(message.get("body", b""))
        if n_bytes > MAX_BODY_BYTES:
            raise HTTPException(413, TOO_LARGE)
        return message

    return limited


def _too_late(detail: str) -> ProblemError:
    # the client may still be sending the body
    headers = {"Retry-After": "5", "Connection": "close"}
    return ProblemError(503, "No answer in time", detail, headers=headers)


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
