"""JSON answers of the API: entity tags (ETag) by revision, cache of encoded answers, headers."""

import asyncio
import gzip
import re
import secrets
from collections import OrderedDict
from collections.abc import Awaitable, Callable, Hashable, Mapping
from contextvars import copy_context
from dataclasses import dataclass, field
from hashlib import blake2b
from inspect import iscoroutinefunction
from typing import Any, TypeVar, cast

import pyarrow as pa
from fastapi import Request, Response
from pydantic import BaseModel
from pydantic_core import to_json
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from acquisition.clock import Clock
from service.api.auth.authenticator import CALLER
from service.api.problems import ProblemError
from service.runtime.asker import ASKER, Asker
from service.runtime.times import rfc3339
from service.store.port import StoreError

T = TypeVar("T")

Answer = BaseModel | Mapping[str, Any] | bytes
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

MAX_CACHE_BYTES = 16_000_000

MAX_KNOWN = 4096
"""Number of answered requests that can be repeated without routing; ten for each open page."""

Revision = Callable[[], Hashable]
Remake = Callable[[str | None], Make]


async def in_thread(do: Callable[[], T]) -> T:
    """Call a function in a thread; return its result."""
    return await asyncio.to_thread(do)


def json_of(answer: BaseModel | Mapping[str, Any]) -> bytes:
    """Return an answer as JSON; NaN and infinity in a mapping become null."""
    return to_json(answer, inf_nan_mode="null")


def tag_of(*parts: bytes) -> str:
    """Return the weak entity tag (RFC 9110, 8.8.3) of the content that the parts identify."""
    return f'W/"{blake2b(b" ".join(parts), digest_size=12).hexdigest()}"'


def is_known(tag: str, if_none_match: str | None) -> bool:
    """Whether an If-None-Match header contains an entity tag: the client has cached the answer.

    `if_none_match` is the value of the header: comma-separated entity tags, or ``*``; None without
    the header.
    """
    if if_none_match is None:
        return False
    named = {each.strip().removeprefix("W/") for each in if_none_match.split(",")}
    return "*" in named or tag.removeprefix("W/") in named


def encoding_of(headers: Headers) -> str:
    """Return the preferred content encoding that a client accepts; empty for none."""
    accepted = {}
    for each in headers.get("accept-encoding", "").lower().split(","):
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
    remembered by caller, so that `Repetition` can answer them again without routing.
    """

    def __init__(self, max_bytes: int = MAX_CACHE_BYTES) -> None:
        self.started = secrets.token_hex(4)
        """Identifier of this start of the process; revisions of other starts are not comparable."""
        self._max_bytes, self._n_bytes = max_bytes, 0
        self._kept: OrderedDict[tuple[str, str], Response] = OrderedDict()
        self._making: dict[tuple[str, str], _Making] = {}
        self._known: OrderedDict[Hashable, tuple[Revision, Remake, object]] = OrderedDict()

    async def of(
        self, request: Request, revision: Revision, make: Make, lasting: Remake | None = None
    ) -> Response:
        """Return the answer to a request; status 304 at once if the client has cached it.

        Parameters
        ----------
        revision
            Function that returns a value that changes whenever the answer changes; the text of
            the value identifies the answer.
        make
            Function that returns the answer; bytes are JSON. It is called in a thread and may
            block, or is a coroutine function.
        lasting
            Function from the parameter ``since`` of a repeated request, which may differ, to the
            `make` of the answer; None if a repeated request must be routed again.
        """
        if lasting is not None:
            self._known[_asked(request.scope)[0]] = revision, lasting, request.scope.get("route")
            if len(self._known) > MAX_KNOWN:
                self._known.popitem(last=False)
        return await self._of(request.scope, revision, make)

    async def repeated(self, scope: Scope) -> Response | None:
        """Return the answer to a request that was answered before; None if it must be routed."""
        asked, since = _asked(scope)
        if scope["method"] != "GET" or asked not in self._known:
            return None
        self._known.move_to_end(asked)
        revision, lasting, scope["route"] = self._known[asked]
        try:
            return await self._of(scope, revision, lasting(since))
        except (ProblemError, StoreError):
            return None  # the route raises it again

    async def _of(self, scope: Scope, revision: Revision, make: Make) -> Response:
        headers = Headers(scope=scope)
        url = scope["path"].encode() + b"?" + scope["query_string"]
        tag = tag_of(self.started.encode(), url, repr(revision()).encode())
        if is_known(tag, headers.get("if-none-match")):
            return Response(status_code=304, headers={"ETag": tag})
        key = (tag, encoding_of(headers))
        if (kept := self._kept.get(key)) is not None:
            self._kept.move_to_end(key)
            return kept
        return await self._made(key, make)

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
            body, headers = encoded(made if isinstance(made, bytes) else json_of(made), encoding)
            return Response(body, media_type=JSON, headers={"ETag": tag, **headers})

        if iscoroutinefunction(make):
            response = await asyncio.to_thread(answer, await make())
        else:
            response = await asyncio.to_thread(lambda: answer(cast("Answer", make())))
        self._keep(key, response)
        return response

    def _keep(self, key: tuple[str, str], response: Response) -> None:
        self._kept[key] = response
        self._n_bytes += len(response.body)
        while self._n_bytes > self._max_bytes:
            _, dropped = self._kept.popitem(last=False)
            self._n_bytes -= len(dropped.body)


async def rendered(make: Callable[[], BaseModel]) -> Response:
    """Return a response with the JSON text of a model that `make` builds in a thread."""
    return Response(await asyncio.to_thread(lambda: json_of(make())), media_type=JSON)


SINCE = re.compile(rb"since=([0-9a-f]+-[0-9]{1,18})")
"""Query of a request for changes after a revision, which differs from poll to poll."""


def _asked(scope: Scope) -> tuple[Hashable, str | None]:
    """Return what an answer depends on, and the value of ``since`` if it is the only parameter.

    The former are caller, URL without that value, and headers that select or describe content. The
    state of a request contains its caller below `CALLER`.
    """
    caller, query = scope.get("state", {}).get(CALLER), scope["query_string"]
    headers = tuple(h for h in scope["headers"] if h[0] in (b"accept", b"content-length"))
    found = SINCE.fullmatch(query)
    asked = caller and caller.identity, scope["path"], b"since" if found else query, headers
    return asked, found[1].decode() if found else None


class Repetition:
    """ASGI middleware that answers requests without routing if they were answered before.

    It applies to requests that the same caller with the same rights has made before: permission
    and parameters were checked then. Fifty polling pages cost half of what routing them costs.
    """

    def __init__(self, app: ASGIApp, answers: Answers) -> None:
        self._app, self._answers = app, answers

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or forward it."""
        answer = await self._answers.repeated(scope)
        await (answer or self._app)(scope, receive, send)


TIME_HEADER = "Padwatch-Time"
"""Name of the header with the time of the answer, from which clients compute ages."""

CACHE_CONTROL = "private, no-cache"
"""Value of the header Cache-Control: private caches only, revalidation before each use."""


class AnswerHeaders:
    """ASGI middleware that adds the time to API answers, and tags and compresses JSON answers.

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
    if is_known(headers["ETag"], asked.get("if-none-match")):
        head["status"], body = 304, b""
        del headers["Content-Length"], headers["Content-Type"]
        return {"type": "http.response.body", "body": b""}
    body, added = encoded(body, encoding_of(asked))
    headers.update(added | {"Content-Length": str(len(body))})
    return {"type": "http.response.body", "body": body}


ORIGIN_HEADER, EDITION_HEADER = "Padwatch-Origin", "Padwatch-Edition"
