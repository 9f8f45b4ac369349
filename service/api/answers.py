"""JSON answers of the API: rendering in threads, entity tags (ETag), caches and headers."""

import asyncio
import re
from collections.abc import Callable, Hashable
from contextvars import Context, copy_context
from hashlib import blake2b
from typing import TypeVar

from fastapi import Response
from pydantic import BaseModel
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from acquisition.clock import Clock
from service.api.values import DatedAnswer
from service.runtime.asker import ASKER
from service.runtime.times import rfc3339

_AGE = re.compile(rb'("(?:data_)?age_s":)[0-9][0-9.e+-]*')

_DIGEST_BYTES = 12


def digest_of(content: bytes) -> bytes:
    """Return the digest of a JSON text, ignoring the fields ``age_s`` and ``data_age_s``."""
    if b'age_s":' in content:  # most answers have none
        content = _AGE.sub(rb"\1", content)
    return blake2b(content, digest_size=_DIGEST_BYTES).digest()


def tag_of(*digests: bytes) -> str:
    """Return the weak entity tag (RFC 9110, 8.8.3) of an answer from the digests of its parts."""
    return f'W/"{blake2b(b"".join(digests), digest_size=_DIGEST_BYTES).hexdigest()}"'


def is_known(tag: str, if_none_match: str | None) -> bool:
    """Whether an If-None-Match header contains an entity tag: the client has cached the answer.

    Parameters
    ----------
    if_none_match
        Value of the header: comma-separated entity tags, or ``*``; None without the header.
    """
    if if_none_match is None:
        return False
    named = {each.strip().removeprefix("W/") for each in if_none_match.split(",")}
    return "*" in named or tag.removeprefix("W/") in named


T = TypeVar("T")

JSON = "application/json"


async def in_thread(do: Callable[[], T]) -> T:
    """Call a function in a thread; return its result."""
    return await asyncio.to_thread(do)


async def rendered(make: Callable[[], BaseModel]) -> Response:
    """Build an API model in a thread; return a JSON response with its entity tag.

    Parameters
    ----------
    make
        Function that builds the model; may block.
    """
    return await asyncio.to_thread(lambda: _response(*_content(make())))


async def rendered_now(make: Callable[[], DatedAnswer]) -> Response:
    """Build an API model in a thread; return a JSON response whose entity tag ignores `time`.

    Parameters
    ----------
    make
        Function that builds the model; may block. Its field `time` must precede nested times.
    """
    return await asyncio.to_thread(lambda: _dated(make()))


class Renderings:
    """Cache of large JSON answers that seldom change, with eviction of the least recently used.

    Parameters
    ----------
    n_kept
        Maximum number of cached answers.
    """

    def __init__(self, n_kept: int = 16) -> None:
        self._n_kept = n_kept
        self._kept: dict[Hashable, tuple[object, bytes, str]] = {}

    async def of(self, key: Hashable, source: T, make: Callable[[T], BaseModel]) -> Response:
        """Return the JSON response for a key, rendered again if `source` is a new object.

        Parameters
        ----------
        source
            Object from which the answer is made; compared by identity.
        make
            Function that builds the API model from `source` in a thread; may block.
        """
        kept = self._kept.pop(key, None)
        if kept is None or kept[0] is not source:
            kept = (source, *await in_thread(lambda: _content(make(source))))
        self._kept[key] = kept
        while len(self._kept) > self._n_kept:
            del self._kept[next(iter(self._kept))]
        return _response(*kept[1:])


def _response(content: bytes, tag: str) -> Response:
    return Response(content, media_type=JSON, headers={"ETag": tag})


def _content(model: BaseModel) -> tuple[bytes, str]:
    content = model.model_dump_json().encode()
    return content, tag_of(digest_of(content))


def _dated(model: DatedAnswer) -> Response:
    content = model.model_dump_json().encode()
    undated = content.replace(f'"time":"{model.time}"'.encode(), b"", 1)
    return _response(content, tag_of(digest_of(undated)))


FRESH_S = 1.0
"""Maximum age of a shared answer, s; some states change with time without a new revision."""


class SharedAnswer:
    """Cached JSON answer of one route, shared by all requests.

    Parameters
    ----------
    make
        Function that builds the API model in a thread; may block.
    revision
        Function that returns a number; a new number makes the cached answer outdated.
    """

    def __init__(
        self, make: Callable[[], DatedAnswer], revision: Callable[[], int], clock: Clock
    ) -> None:
        self._make, self._revision, self._clock = make, revision, clock
        self._made: tuple[int, float, asyncio.Task[Response]] | None = None

    async def answer(self) -> Response:
        """Return a response with the cached answer; render the answer first if it is outdated."""
        revision, now_s = self._revision(), self._clock.monotonic_s()
        if self._made is None or self._made[0] != revision or now_s - self._made[1] >= FRESH_S:
            making = asyncio.create_task(rendered_now(self._make), context=_shared_context())
            self._made = (revision, now_s, making)
        # a client that disconnects must not cancel the answer of other clients
        shared = await asyncio.shield(self._made[2])
        return _response(bytes(shared.body), shared.headers["etag"])


def _shared_context() -> Context:
    """Return a copy of the context variables without the client, which may disconnect."""
    context = copy_context()
    context.run(ASKER.set, None)
    return context


TIME_HEADER = "Padwatch-Time"
"""Name of the header with the time of the answer, for correcting ages in cached answers."""

CACHE_CONTROL = "private, no-cache"
"""Value of the header Cache-Control: private caches only, revalidation before each use."""


class Revalidation:
    """ASGI middleware that adds missing entity tags, and answers 304 for a cached answer."""

    def __init__(self, app: ASGIApp, clock: Clock) -> None:
        self._app, self._clock = app, clock

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request; add caching headers and the entity tag to its answer."""
        if scope["type"] != "http" or not scope["path"].startswith("/api/"):
            await self._app(scope, receive, send)
            return
        answer = _Answer(send, self._clock, scope)
        await self._app(scope, receive, answer.send)


class _Answer:
    """Buffer for the head of an answer, which is sent when the body has determined the tag."""

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
        """Complete `head`; return the body: empty, with status 304, if the client has cached it."""
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


ORIGIN_HEADER, EDITION_HEADER = "Padwatch-Origin", "Padwatch-Edition"
