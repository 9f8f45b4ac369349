"""Every JSON answer of the API has a tag; who names it again is told that nothing is new."""

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from acquisition.clock import Clock
from service.api.entity_tags import digest_of, is_known, tag_of
from service.runtime.times import rfc3339

TIME_HEADER = "Padwatch-Time"
"""When an answer was given: by it, ages are counted on in a body that was kept."""

CACHE_CONTROL = "private, no-cache"
"""Keep it for yourself, and ask before each use whether it is still so."""


class Revalidation:
    """ASGI middleware; a route that can tell its tag without its answer sets ``ETag`` itself."""

    def __init__(self, app: ASGIApp, clock: Clock) -> None:
        self._app, self._clock = app, clock

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, and look at what comes back."""
        if scope["type"] != "http" or not scope["path"].startswith("/api/"):
            await self._app(scope, receive, send)
            return
        answer = _Answer(send, self._clock, scope)
        await self._app(scope, receive, answer.send)


class _Answer:
    """Holds the head of an answer back until the body is there that the tag is made of."""

    def __init__(self, send: Send, clock: Clock, scope: Scope) -> None:
        self._send, self._clock = send, clock
        self._is_read = scope["method"] == "GET"
        self._named = Headers(scope=scope).get("if-none-match")
        self._head: Message | None = None

    async def send(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            MutableHeaders(scope=message)[TIME_HEADER] = rfc3339(self._clock.now_ns())
            if self._is_read and _is_whole_json(message):
                self._head = message
                return
        elif self._head is not None:
            head, self._head = self._head, None
            message = self._judged(head, message)
            await self._send(head)
        await self._send(message)

    def _judged(self, head: Message, body: Message) -> Message:
        """Put the tag on the head; take the body away from who has it."""
        headers = MutableHeaders(scope=head)
        if "ETag" not in headers:
            headers["ETag"] = tag_of(digest_of(body.get("body", b"")))
        headers["Cache-Control"] = CACHE_CONTROL
        headers.add_vary_header("Accept")
        if not is_known(headers["ETag"], self._named):
            return body
        head["status"] = 304
        for name in ("Content-Length", "Content-Type"):
            del headers[name]
        return {"type": "http.response.body", "body": b""}


def _is_whole_json(head: Message) -> bool:
    headers = Headers(scope=head)
    is_json = headers.get("content-type") == "application/json"
    return head["status"] == 200 and is_json and "content-length" in headers
