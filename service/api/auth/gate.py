"""Authentication of callers by middleware, and check of the permission for each route."""

from collections.abc import Callable, Mapping

from fastapi import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.auth.authenticator import BEARER_ONLY, Authenticator
from service.api.auth.credentials import CALLER, Caller, is_foreign
from service.api.auth.declared import Declared, Reach
from service.api.problems import DETAIL, STORE_FAILS, ProblemError, problem_answer
from service.store.access.audit_entries import Acting, Source, acting, acting_as, name_actor
from service.store.access.identities import LOCAL, Identity, Means
from service.store.port import StoreError

SAFE = ("GET", "HEAD", "OPTIONS")
"""Safe HTTP methods, which change no state."""

REFUSED = (401, 403, 409, 413, 422, 429)
"""HTTP statuses of refused requests."""


def not_logged_in() -> ProblemError:
    """Return the error with status 401 for an unauthenticated request."""
    detail = "log in, or send a valid API key"
    return ProblemError(401, "Not logged in", detail, headers=BEARER_ONLY)


def not_this_unit() -> ProblemError:
    """Return the error with status 403 for an API key that is not valid for the requested unit."""
    detail = "this key is limited to some units; request one of them"
    return ProblemError(403, "Not allowed", detail)


CHANGE_PASSWORD = "POST /api/v1/session/password"  # noqa: S105  an operation


class Gate:
    """ASGI middleware that authenticates callers, and protects routes that are not open.

    It adds the client address to audit entries, and records refused changes in the audit trail.
    `declared` returns the operations of the application, with their requirements, by name.
    """

    def __init__(
        self,
        app: ASGIApp,
        declared: Callable[[], Mapping[str, Declared]],
        authenticator: Authenticator,
    ) -> None:
        self._app, self._declared, self._desk = app, declared, authenticator

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request with its caller in the state; answer 401, 403 or 503 if refused."""
        client, status = scope.get("client"), 0
        state = scope.setdefault("state", {})

        async def watched(message: Message) -> None:
            nonlocal status
            status = message.get("status", status)
            await send(message)

        with acting_as(Acting(Source.API, str(client[0]) if client else None)):
            try:
                await self._admit(scope)
            except ProblemError as error:
                await problem_answer(Request(scope), error)(scope, receive, watched)
            else:
                await self._app(scope, receive, watched)
            if scope["method"] not in SAFE and status in REFUSED:
                operation = f"{scope['method']} {scope['path']}"
                await self._desk.record_refusal(operation, state.get(DETAIL, ""), status)

    async def _admit(self, scope: Scope) -> None:
        try:
            caller = await self._desk.caller(scope)
        except StoreError as error:
            raise ProblemError(503, "Store not available", STORE_FAILS) from error
        scope["state"][CALLER] = caller
        if caller.identity is None and not self._is_open(scope):
            raise not_logged_in()
        _require_own_page(scope, caller)
        if caller.identity is not None and caller.identity.is_proven:
            name_actor(caller.identity.actor)

    def _is_open(self, scope: Scope) -> bool:
        return any(
            each.is_open and each.method == scope["method"] and each.matches(scope["path"])
            for each in self._declared().values()
        )


def _require_own_page(scope: Scope, caller: Caller) -> None:
    """Raise a problem of status 403 if a page of another origin requests a change."""
    if scope["method"] in SAFE or caller.shown.means is Means.KEY:
        return
    if is_foreign(scope, requires_origin=caller.shown.means is not None):
        detail = "requests from pages of other sites are rejected"
        raise ProblemError(403, "Cross-site request", detail)


def caller_of(request: Request) -> Caller:
    """Return the caller of a request, as identified by `Gate`."""
    caller: Caller = request.scope["state"][CALLER]
    return caller


async def require_declared(request: Request) -> None:
    """Check that the caller has the permission that the route declares; dependency of all routes.

    Raises `ProblemError` with status 401 if the caller is not authenticated; 403 if the role or
    units of the caller are not sufficient, or if the caller must first change the password.
    """
    operation = f"{request.method} {request.scope['route'].path}"
    needed = request.app.declared[operation].needs
    if needed.permission is None:
        return
    identity = caller_of(request).identity
    if identity is None:
        raise not_logged_in()
    if identity.must_change_password and operation != CHANGE_PASSWORD:
        detail = "an administrator set your password; change it before other requests"
        raise ProblemError(403, "Password change required", detail)
    if not identity.role.may(needed.permission):
        if identity.is_proven:
            raise ProblemError(403, "Not allowed", "your role does not permit this request")
        raise not_logged_in()
    unit = _unit_of(request.path_params)
    if needed.reach is Reach.ASKED:
        units = request.query_params.getlist("unit")
        unit = units[0] if len(units) == 1 else None
    if unit is None and needed.reach is not Reach.NO_UNIT and identity.units:
        raise not_this_unit()
    if not identity.may(needed.permission, unit):
        raise not_this_unit()


def identity_of(request: Request) -> Identity:
    """Return the identity of the caller; raise `ProblemError` (401) without an identity."""
    identity = caller_of(request).identity
    if identity is None:
        raise not_logged_in()
    return identity


def _unit_of(parameters: Mapping[str, str]) -> str | None:
    """Return the unit in the path, or in an alarm identifier in the path; None without a unit."""
    if "unit" in parameters:
        return parameters["unit"]
    if "alarm" in parameters:
        return parameters["alarm"].partition(":")[0]
    return None


def actor_or(given: str | None) -> str:
    """Return the name of the actor: the authenticated name, else `given`, else `LOCAL`."""
    return acting().actor or given or LOCAL


async def name_caller(request: Request) -> None:
    """Set the caller as the actor of the audit entries of this request, also without a login.

    This is a coroutine, since FastAPI runs plain functions in threads with separate contexts.
    """
    name_actor(identity_of(request).actor)
