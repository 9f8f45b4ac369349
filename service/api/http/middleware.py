"""ASGI middleware between HTTP server and application: checks of hosts, bodies and load."""

import asyncio
import re
from collections.abc import Iterable, Sequence
from ipaddress import ip_address

from starlette.datastructures import MutableHeaders
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.http.refusals import (
    BODY_TOO_LARGE,
    BUSY,
    NO_ANSWER,
    NO_HOST,
    NOT_UTF8,
    TOO_DEEP,
    WRONG_HOST,
    Refusal,
)
from service.runtime.asker import ASKER, Asker
from service.settings.processes import HttpLimitSettings


class HeadRequests:
    """ASGI middleware that handles HEAD as GET without a body (RFC 9110, 9.3.2)."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request; drop the body of the answer to a HEAD request."""
        if scope.get("method") != "HEAD":
            await self._app(scope, receive, send)
            return

        async def without_body(message: Message) -> None:
            if message["type"] == "http.response.body":
                message = {**message, "body": b""}
            await send(message)

        await self._app({**scope, "method": "GET"}, receive, without_body)


HOST = re.compile(r"(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+)(?::[0-9]{1,5})?")
"""Pattern of a Host header: name, IPv4 address or bracketed IPv6 address, and optional port."""

LOOPBACK = ("localhost", "127.0.0.1", "::1")


class KnownHosts:
    """ASGI middleware that refuses requests with an unknown host in the Host header.

    This prevents DNS rebinding, by which another site resolves its own host name to 127.0.0.1; its
    requests contain that host name.

    Parameters
    ----------
    hosts
        Accepted host names and addresses without port, in addition to loopback and the address of
        the server.
    """

    def __init__(self, app: ASGIApp, hosts: Iterable[str]) -> None:
        self._app = app
        self._known = {host.lower().strip("[]").rstrip(".") for host in (*LOOPBACK, *hosts)}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request if its Host header names this service; otherwise refuse it."""
        asked = [value for name, value in scope["headers"] if name == b"host"]
        if len(asked) != 1 or not asked[0]:
            await NO_HOST.send(scope, send)
        elif self._is_known(_name(asked[0].decode("latin-1")), scope):
            await self._app(scope, receive, send)
        else:
            await WRONG_HOST.send(scope, send)

    def _is_known(self, name: str, scope: Scope) -> bool:
        address, _ = scope.get("server") or ("", None)
        return name in self._known or (bool(name) and name == address.removeprefix("::ffff:"))


def _name(host: str) -> str:
    """Return the host name of a Host header, without port; empty if the header is malformed."""
    found = HOST.fullmatch(host)
    return found[1].strip("[]").rstrip(".").lower() if found else ""


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
    """ASGI middleware that adds headers to all answers that do not contain them."""

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


FOR, PROTO = b"x-forwarded-for", b"x-forwarded-proto"


class TrustedProxy:
    """ASGI middleware that takes client address and scheme from the headers of a trusted proxy."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request with the client and scheme reported by the proxy."""
        if scope["type"] == "http":
            scope["client"] = _client(_last(scope, FOR))
            scope["scheme"] = "https" if _last(scope, PROTO).lower() == "https" else "http"
        await self._app(scope, receive, send)


def _last(scope: Scope, name: bytes) -> str:
    """Return the last value of a list header, which the proxy added; empty without the header."""
    values = [value for found, value in scope["headers"] if found == name]
    return values[-1].decode("latin-1").rpartition(",")[2].strip() if values else ""


def _client(address: str) -> tuple[str, int] | None:
    try:
        return str(ip_address(address)), 0
    except ValueError:
        return None


TOKEN = re.compile(rb'"(?:[^"\\]++|\\.)*+"?|[\[{]|[\]}]', re.DOTALL)
"""Pattern of a JSON string, terminated or not, or of a bracket; matching never backtracks."""


def is_deeper_than(limit: int, text: bytes) -> bool:
    """Whether arrays and objects in a JSON text, even an invalid one, exceed a nesting depth."""
    if text.count(b"[") + text.count(b"{") <= limit:
        return False  # true for all usual requests, and faster than scanning strings
    depth = 0
    for match in TOKEN.finditer(text):
        first = text[match.start()]
        if first in b"[{":
            depth += 1
            if depth > limit:
                return True
        elif first in b"]}":
            depth -= 1
    return False


class TooLargeError(Exception):
    """Raised if a request body exceeds the size limit."""


class WholeBodies:
    """ASGI middleware that receives and checks the whole request body before the application runs.

    The deadlines of `GuardedProtocol` limit the duration of receiving.
    """

    def __init__(self, app: ASGIApp, limits: HttpLimitSettings) -> None:
        self._app, self._limits = app, limits

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Receive and check the body, then forward the request, or refuse it."""
        try:
            body = await self._body(scope, receive)
        except TooLargeError:
            await BODY_TOO_LARGE.send(scope, send)
            return
        except ClientDisconnect:
            return
        refusal = self._wrong(body)
        if refusal is not None:
            await refusal.send(scope, send)
            return
        await self._app(scope, _replayed(body, receive), send)

    async def _body(self, scope: Scope, receive: Receive) -> bytes:
        limit = 1024 * self._limits.max_body_kb
        if any(
            _declares_more(value, limit)
            for name, value in scope["headers"]
            if name == b"content-length"
        ):
            raise TooLargeError
        body = bytearray()
        while True:
            message = await receive()
            if message["type"] == "http.disconnect":
                raise ClientDisconnect
            body += message.get("body", b"")
            if len(body) > limit:
                raise TooLargeError
            if not message.get("more_body", False):
                return bytes(body)

    def _wrong(self, body: bytes) -> Refusal | None:
        try:
            body.decode()
        except UnicodeDecodeError:
            return NOT_UTF8
        return TOO_DEEP if is_deeper_than(self._limits.max_json_depth, body) else None


def _declares_more(length: bytes, limit: int) -> bool:
    digits = length.strip().lstrip(b"0")
    # int() is slow for very long numbers, and fails for more than 4300 digits
    return len(digits) > 18 or int(digits or b"0") > limit


def _replayed(body: bytes, receive: Receive) -> Receive:
    """Return a `receive` function that gives the whole body first, then messages from `receive`."""
    whole: list[Message] = [{"type": "http.request", "body": body, "more_body": False}]

    async def given() -> Message:
        return whole.pop() if whole else await receive()

    return given


class BoundedAnswers:
    """ASGI middleware that limits the number and duration of concurrent requests.

    Both limits apply until the answer starts; then the deadlines of `GuardedProtocol` apply.
    """

    def __init__(self, app: ASGIApp, limits: HttpLimitSettings) -> None:
        self._app, self._limits = app, limits
        self._n_running = 0
        self._deadlines: set[asyncio.Timeout] = set()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request; answer 503 above the limit, or if no answer starts in time."""
        if self._n_running >= self._limits.max_requests:
            await BUSY.send(scope, send)
            return
        asker = Asker()
        before = ASKER.set(asker)
        try:
            is_answered = await self._answered(scope, receive, send)
        finally:
            asker.has_gone = True  # cancels store reads that still run in a thread
            ASKER.reset(before)
        if not is_answered:
            await NO_ANSWER.send(scope, send)

    def give_up(self) -> None:
        """Cancel all requests whose answers have not started."""
        for deadline in self._deadlines:
            deadline.reschedule(0.0)

    async def _answered(self, scope: Scope, receive: Receive, send: Send) -> bool:
        has_begun = False

        async def watched(message: Message) -> None:
            nonlocal has_begun
            if deadline.expired():
                return  # sent while the application is cancelled
            if not has_begun:
                has_begun = True
                self._n_running -= 1
                self._deadlines.discard(deadline)
                deadline.reschedule(None)
            await send(message)

        self._n_running += 1
        try:
            async with asyncio.timeout(self._limits.answer_s) as deadline:
                self._deadlines.add(deadline)
                await self._app(scope, receive, watched)
        except TimeoutError:
            if not deadline.expired():
                raise
            return False
        finally:
            self._deadlines.discard(deadline)
            if not has_begun:
                self._n_running -= 1
        return True


def guarded(answers: BoundedAnswers, limits: HttpLimitSettings, hosts: Iterable[str]) -> ASGIApp:
    """Return `answers` inside the middleware for bodies, hosts, headers and HEAD requests.

    Bodies are read before requests are counted, so that slow clients do not exhaust the limit.
    """
    bodies = WholeBodies(answers, limits)
    return HeadRequests(AddedHeaders(KnownHosts(bodies, hosts), SECURITY_HEADERS))
