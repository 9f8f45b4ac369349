"""Audit entries for refused requests, with a rate limit."""

import asyncio
import json

import structlog
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from acquisition.clock import Clock
from service.api.auth.gate import SAFE
from service.api.load import TokenBucket
from service.store.access.audit_entries import Acting, AuditAction, Source, acting, acting_as
from service.store.audit import AuditStore
from service.store.port import StoreError

log = structlog.get_logger()

N_AT_ONCE = 20
"""Burst limit: maximum number of refusals in quick succession that are recorded."""

SECONDS_EACH = 30.0
"""Time after which one more refusal may be recorded, s: at most 2,880 a day."""


class Refusals:
    """Writer of audit entries for refused requests; above a rate limit, refusals are only counted.

    Parameters
    ----------
    audit
        Database of the audit trail.
    """

    def __init__(self, audit: AuditStore, clock: Clock) -> None:
        self._audit, self._clock = audit, clock
        self._allowance = TokenBucket(N_AT_ONCE, SECONDS_EACH, clock.monotonic_s())
        self.n_more = 0

    async def note(self, deed: AuditAction, status: int) -> None:
        """Record a refused request; above the rate limit, count it for the next entry.

        Parameters
        ----------
        deed
            Audit entry without the status.
        status
            HTTP status of the answer.
        """
        if not self._allowance.take(self._clock.monotonic_s()):
            self.n_more += 1
            return
        n_before, self.n_more = self.n_more, 0
        after = {"status": status} | ({"n_refused_more": n_before} if n_before else {})
        entry = AuditAction(**{**vars(deed), "after": after})
        try:
            await asyncio.to_thread(self._audit.record, [entry])
        except StoreError as error:
            self.n_more += n_before + 1
            log.error("a rejected request is missing in the audit trail", reason=str(error))


REFUSED = (401, 403, 409, 413, 422, 429)

MAX_PROBLEM = 8192
"""Maximum size of a problem document that is read for the audit entry, bytes."""


class AuditTrail:
    """ASGI middleware that gives audit entries the client address, and records refused changes.

    Parameters
    ----------
    refusals
        Writer of audit entries for refused requests.
    """

    def __init__(self, app: ASGIApp, refusals: Refusals, clock: Clock) -> None:
        self._app, self._refusals, self._clock = app, refusals, clock

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request; record it if it would change state and is refused."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        client = scope.get("client")
        with acting_as(Acting(Source.API, str(client[0]) if client else None)):
            answer = _Answer(send)
            await self._app(scope, receive, answer.send)
            if scope["method"] not in SAFE and answer.status in REFUSED:
                await self._refusals.note(self._deed(scope, answer), answer.status)

    def _deed(self, scope: Scope, answer: "_Answer") -> AuditAction:
        who = acting()
        return AuditAction(
            time_ns=self._clock.now_ns(),
            actor=who.actor,
            action="request.refused",
            object=f"{scope['method']} {scope['path']}",
            reason=answer.detail,
            source=who.source,
            peer=who.peer,
        )


class _Answer:
    """Forwarder of one answer, which keeps the status and, for a refusal, the problem document."""

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
        """Detail of the problem document; empty without a problem document."""
        try:
            problem = json.loads(self._body[:MAX_PROBLEM])
        except (ValueError, RecursionError):
            return ""
        return str(problem.get("detail", "")) if isinstance(problem, dict) else ""
