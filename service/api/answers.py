"""JSON answers of the API: entity tags (ETag) by revision, cache of encoded answers, headers."""

import asyncio
import gzip
import re
import secrets
import time
from collections import OrderedDict
from collections.abc import Awaitable, Callable, Hashable, Iterable, Mapping
from contextlib import suppress
from contextvars import copy_context
from dataclasses import dataclass, field
from functools import lru_cache
from hashlib import blake2b
from inspect import iscoroutinefunction
from typing import Any, cast

import pyarrow as pa
from fastapi import Request, Response
from pydantic import BaseModel
from pydantic_core import to_json
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from acquisition.clock import Clock
from service.api.auth.credentials import CALLER, Caller
from service.api.problems import ProblemError
from service.runtime.asker import ASKER, Asker
from service.runtime.times import rfc3339
from service.store.access.identities import Identity
from service.store.port import StoreError

Answer = BaseModel | Mapping[str, Any]
Make = Callable[[], Answer] | Callable[[], Awaitable[Answer]]

JSON = "application/json"

MIN_ENCODED_BYTES = 1000
"""Size from which a body is compressed, bytes; a smaller body fits into one packet anyway."""

ZSTD = pa.Codec("zstd", compression_level=1)

ENCODINGS: dict[str, Callable[[bytes], bytes]] = {
    "zstd": lambda body: ZSTD.compress(body, asbytes=True),
    "gzip": lambda body: gzip.compress(body, 1, mtime=0),
}
"""Content encodings, the preferred one first."""

MAX_KNOWN = 4096
"""Number of answered requests that can be repeated without routing; ten for each open page."""

Revision = Callable[[], Hashable]


def json_of(answer: Answer) -> bytes:
    """Return an answer as JSON; NaN and infinity in a mapping become null."""
    return to_json(answer, inf_nan_mode="null")


def tag_of(*parts: bytes) -> str:
    """Return the weak entity tag (RFC 9110, 8.8.3) of the content that the parts identify."""
    return f'W/"{blake2b(b" ".join(parts), digest_size=12).hexdigest()}"'


def is_known(tag: str, if_none_match: str) -> bool:
    """Whether an If-None-Match header contains an entity tag: the client has cached the answer.

    `if_none_match` is the value of the header: comma-separated entity tags, or ``*``; empty without
    the header.
    """
    named = {each.strip().removeprefix("W/") for each in if_none_match.split(",")}
    return "*" in named or tag.removeprefix("W/") in named


@lru_cache
def encoding_of(accept_encoding: str) -> str:
    """Return the preferred content encoding that a client accepts; "" for no encoding."""
    accepted = {}
    for each in accept_encoding.lower().split(","):
        name, _, quality = each.replace(" ", "").partition(";q=")
        accepted[name] = quality.strip("0.") != "" if quality else True
    return next((name for name in ENCODINGS if accepted.get(name, False)), "")


def encoded(body: bytes, encoding: str) -> tuple[bytes, dict[str, str]]:
    """Return a body in a content encoding, and headers for it; a small body is not encoded."""
    if not encoding or len(body) < MIN_ENCODED_BYTES:
        return body, {}
    return ENCODINGS[encoding](body), {"Content-Encoding": encoding}


@dataclass
class _Making:
    """Answer that is being made for one or several clients.

    `asker` is the common client of the store reads, which are cancelled when the last client has
    gone.
    """

    task: asyncio.Task[Response]
    asker: Asker
    n_clients: int = field(default=0)


class Answers:
    """Cache of encoded answers, by path, query, revision and content encoding.

    If the bodies exceed `max_bytes` together, the least recently used answers are dropped.
    Concurrent requests for the same answer wait for one computation of it. Answered requests are
    remembered by caller, so that `Repetition` can answer them again.
    """

    def __init__(self, max_bytes: int = 16_000_000) -> None:
        self.started = secrets.token_hex(4)
        """Identifier of this start of the process; revisions of other starts are not comparable."""
        self._max_bytes, self._n_bytes = max_bytes, 0
        self._kept: OrderedDict[tuple[str, str], Response] = OrderedDict()
        self._making: dict[tuple[str, str], _Making] = {}
        self._known: OrderedDict[Hashable, tuple[Revision, object]] = OrderedDict()

    async def of(
        self, request: Request, revision: Revision, make: Make, *, is_polled: bool = False
    ) -> Response:
        """Return the answer to a request; status 304 at once if the client has cached it.

        Parameters
        ----------
        revision
            Function that returns a value that changes whenever the answer changes; the text of
            the value identifies the answer.
        make
            Function that returns the answer. It is called in a thread and may block, or is a
            coroutine function.
        is_polled
            Whether `revision` applies to later requests for the URL, which `Repetition` may answer.
        """
        scope = request.scope
        if is_polled and (asked := _asked(scope, scope["state"][CALLER].identity)) is not None:
            self._known[asked] = revision, scope["route"]
            if len(self._known) > MAX_KNOWN:
                self._known.popitem(last=False)
        key, ready = self._ready(scope, revision)
        return ready or await self._made(key, make)

    def at_once(self, scope: Scope, identity: Identity | None) -> Response | None:
        """Return the answer to a request of a caller that was answered before.

        Return None if neither this cache nor the cache of the client contains the answer.
        """
        asked = _asked(scope, identity)
        if asked is None or asked not in self._known:
            return None
        self._known.move_to_end(asked)
        revision, scope["route"] = self._known[asked]
        try:
            return self._ready(scope, revision)[1]
        except (ProblemError, StoreError):
            return None  # the route raises it again

    def _ready(self, scope: Scope, revision: Revision) -> tuple[tuple[str, str], Response | None]:
        """Return the key of an answer in the cache, and the answer if it need not be made."""
        headers = Headers(scope=scope)
        url = scope["path"].encode() + b"?" + scope["query_string"]
        tag = tag_of(self.started.encode(), url, repr(revision()).encode())
        key = (tag, encoding_of(headers.get("accept-encoding", "")))
        if is_known(tag, headers.get("if-none-match", "")):
            return key, Response(status_code=304, headers={"ETag": tag})
        if (kept := self._kept.get(key)) is not None:
            self._kept.move_to_end(key)
        return key, kept

    async def _made(self, key: tuple[str, str], make: Make) -> Response:
        making = self._making.get(key)
        if making is None:
            asker, context = Asker(), copy_context()
            context.run(ASKER.set, asker)
            task = asyncio.create_task(self._make(key, make), context=context)
            making = self._making[key] = _Making(task, asker)
            task.add_done_callback(lambda _: self._forget(key, making))
        making.n_clients += 1
        try:
            # a client that disconnects must not cancel the answer of other clients
            return await asyncio.shield(making.task)
        finally:
            making.n_clients -= 1
            if making.n_clients == 0:
                self._forget(key, making)  # a later client must not get a cancelled answer
                making.asker.leave()

    def _forget(self, key: tuple[str, str], making: _Making) -> None:
        if self._making.get(key) is making:
            del self._making[key]

    async def _make(self, key: tuple[str, str], make: Make) -> Response:
        tag, encoding = key

        def answer(made: Answer) -> Response:
            body, headers = encoded(json_of(made), encoding)
            return Response(body, media_type=JSON, headers={"ETag": tag, **headers})

        if iscoroutinefunction(make):
            response = await asyncio.to_thread(answer, await make())
        else:
            response = await asyncio.to_thread(lambda: answer(cast("Answer", make())))
        self._kept[key] = response
        self._n_bytes += len(response.body)
        while self._n_bytes > self._max_bytes:
            _, dropped = self._kept.popitem(last=False)
            self._n_bytes -= len(dropped.body)
        return response


async def rendered(make: Callable[[], BaseModel]) -> Response:
    """Return a response with the JSON text of a model that `make` builds in a thread."""
    return Response(await asyncio.to_thread(lambda: json_of(make())), media_type=JSON)


SINCE = re.compile(rb"since=[0-9a-f]+-[0-9]{1,18}")
"""Query of a request for changes after a revision, which differs from poll to poll."""


def _asked(scope: Scope, identity: Identity | None) -> Hashable | None:
    """Return what an answer depends on, except the value of ``since`` as the only parameter.

    This is the identity of the caller, the URL, the server address, and the headers that select an
    answer or its host. None for a request that is not repeated: with a body, or another method than
    GET.
    """
    if scope["method"] != "GET":
        return None
    headers = tuple(header for header in scope["headers"] if header[0] in SELECTING)
    if any(name not in (b"accept", b"host") for name, _ in headers):
        return None
    query = scope["query_string"]
    url = scope["path"], b"since" if SINCE.fullmatch(query) else query
    return identity, url, headers, scope.get("server")


SELECTING = (b"accept", b"host", b"content-length", b"transfer-encoding")
"""Headers by which requests for the same URL differ."""


class Repetition:
    """ASGI middleware around all others that repeats answers which are in the cache.

    It applies to requests that the same caller with the same rights has sent to the same host
    before. It computes nothing, so these requests have no deadline and are never refused.

    Parameters
    ----------
    caller
        Coroutine function that authenticates the caller of a request.
    observe
        Function that receives route, status and duration, s, of an answered request.
    headers
        Headers of all answers of the server, in addition to those of `AnswerHeaders`.
    """

    def __init__(
        self,
        app: ASGIApp,
        headers: Iterable[tuple[str, str]],
        *,
        answers: Answers,
        caller: Callable[[Scope], Awaitable[Caller]],
        observe: Callable[[str, int, float], None],
        clock: Clock,
    ) -> None:
        self._app, self._answers, self._caller = app, answers, caller
        self._observe, self._clock = observe, clock
        added = MutableHeaders(dict(headers))
        _add_cache_headers(added)
        self._headers = added.raw

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or forward it."""
        began_s, answer = time.perf_counter(), None
        if scope["method"] == "GET" and scope["path"].startswith("/api/"):
            with suppress(StoreError):
                caller = await self._caller(scope)
                answer = self._answers.at_once(scope, caller.identity)
        if answer is None:
            await self._app(scope, receive, send)
            return
        date = (TIME_HEADER.lower().encode(), rfc3339(self._clock.now_ns()).encode())
        headers, status = [*answer.raw_headers, date, *self._headers], answer.status_code
        await send({"type": "http.response.start", "status": status, "headers": headers})
        await send({"type": "http.response.body", "body": answer.body})
        self._observe(scope["route"].path, status, time.perf_counter() - began_s)


TIME_HEADER = "Padwatch-Time"
"""Name of the header with the time of the answer, from which clients compute ages."""

CACHE_CONTROL = "private, no-cache"
"""Value of the header Cache-Control: private caches only, revalidation before each use."""


class AnswerHeaders:
    """ASGI middleware that adds the host time to API answers; it tags and compresses JSON.

    An answer without an entity tag is tagged by its content.
    """

    def __init__(self, app: ASGIApp, clock: Clock) -> None:
        self._app, self._clock = app, clock

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request; complete its answer."""
        if not scope["path"].startswith("/api/"):
            await self._app(scope, receive, send)
            return
        head: Message | None = None
        asked = Headers(scope=scope)

        async def completed(message: Message) -> None:
            nonlocal head
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers[TIME_HEADER] = rfc3339(self._clock.now_ns())
                is_get, is_json = scope["method"] == "GET", headers.get("content-type") == JSON
                if is_get and "etag" in headers:
                    _add_cache_headers(headers)
                elif is_get and is_json and message["status"] == 200:
                    head = message  # its tag depends on the body
                    return
            elif head is not None:
                whole, head = head, None
                message = _tagged(whole, message, asked)
                await send(whole)
            await send(message)

        await self._app(scope, receive, completed)


def _add_cache_headers(headers: MutableHeaders) -> None:
    headers["Cache-Control"] = CACHE_CONTROL
    headers.add_vary_header("Accept, Accept-Encoding")


def _tagged(head: Message, message: Message, asked: Headers) -> Message:
    """Complete the head of an answer; return its body: encoded, or empty if the client has it."""
    headers, body = MutableHeaders(scope=head), message.get("body", b"")
    headers["ETag"] = tag_of(body)
    _add_cache_headers(headers)
    if is_known(headers["ETag"], asked.get("if-none-match", "")):
        head["status"] = 304
        del headers["Content-Length"], headers["Content-Type"]
        return {"type": "http.response.body", "body": b""}
    body, added = encoded(body, encoding_of(asked.get("accept-encoding", "")))
    headers.update(added | {"Content-Length": str(len(body))})
    return {"type": "http.response.body", "body": body}


ORIGIN_HEADER, EDITION_HEADER = "Padwatch-Origin", "Padwatch-Edition"
