"""Every request says where it comes from to whoever writes it down; refused ones are written."""

import json

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from acquisition.clock import Clock
from service.api.auth.refusals import Refusals
from service.store.access.audit_entries import Acting, Deed, Source, acting, acting_as

SAFE = ("GET", "HEAD", "OPTIONS")

REFUSED = (401, 403, 409, 413, 422, 429)

MAX_PROBLEM = 8192
"""Bytes of a problem document that are looked at."""


class AuditTrail:
    """ASGI middleware around everything else.

    Parameters
    ----------
    refusals
        Takes refused requests that would have changed something.
    """

    def __init__(self, app: ASGIApp, refusals: Refusals, clock: Clock) -> None:
        self._app, self._refusals, self._clock = app, refusals, clock

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, and write it down if it is refused."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        client = scope.get("client")
        with acting_as(Acting(Source.API, str(client[0]) if client else None)):
            answer = _Answer(send)
            await self._app(scope, receive, answer.send)
            if scope["method"] not in SAFE and answer.status in REFUSED:
                await self._refusals.note(self._deed(scope, answer), answer.status)

    def _deed(self, scope: Scope, answer: "_Answer") -> Deed:
        who = acting()
        return Deed(
            time_ns=self._clock.now_ns(),
            actor=who.actor,
            action="request.refused",
            object=f"{scope['method']} {scope['path']}",
            reason=answer.detail,
            source=who.source,
            peer=who.peer,
        )


class _Answer:
    """Passes an answer on and keeps its status and, of a refusal, its problem document."""

    def __init__(self, send: Send) -> None:
        self._send = send
        self.status = 0
        self._body = b""

    async def send(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            self.status = int(message["status"])
        elif self.status in REFUSED and len(self._body) <= MAX_PROBLEM:
            self._body += message.get("body", b"")
        await self._send(message)

    @property
    def detail(self) -> str:
        """What the problem document says; nothing where there is none."""
        try:
            problem = json.loads(self._body[:MAX_PROBLEM])
        except (ValueError, RecursionError):
            return ""
        return str(problem.get("detail", "")) if isinstance(problem, dict) else ""
