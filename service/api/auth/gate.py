"""The gate before all routes: who asks is found out once, and held against what a route needs."""

from collections.abc import Callable, Mapping

from fastapi import Request
from starlette.types import ASGIApp, Receive, Scope, Send

from service.api.auth.credentials import Kind
from service.api.auth.declared import Declared, Reach
from service.api.auth.desk import AccessDesk, Caller
from service.api.auth.refused_requests import (
    must_change_password,
    not_allowed,
    not_logged_in,
    not_this_site,
    not_this_unit,
)
from service.api.auth.same_origin import SAFE, is_foreign
from service.api.problems import ProblemError, problem_answer
from service.store.access.audit_entries import name_actor
from service.store.access.identities import Identity
from service.store.port import StoreError

CHANGE_PASSWORD = "POST /api/v1/session/password"  # noqa: S105  an operation

CALLER = "caller"
"""Where a request keeps who sends it."""


class Gate:
    """ASGI middleware that finds out who asks, and lets nobody in particular to open routes only.

    Parameters
    ----------
    declared
        Tells what each operation needs.
    """

    def __init__(
        self, app: ASGIApp, declared: Callable[[], Mapping[str, Declared]], desk: AccessDesk
    ) -> None:
        self._app, self._declared, self._desk = app, declared, desk

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on if it may go on."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        try:
            await self._admit(scope)
        except ProblemError as error:
            await problem_answer(Request(scope), error)(scope, receive, send)
        else:
            await self._app(scope, receive, send)

    async def _admit(self, scope: Scope) -> None:
        try:
            caller = await self._desk.caller(scope)
        except StoreError as error:
            detail = "the store cannot be read just now"
            raise ProblemError(503, "Store not available", detail) from error
        scope.setdefault("state", {})[CALLER] = caller
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
    """Refuse what a page of another origin lets a browser send."""
    if scope["method"] in SAFE or caller.shown.kind is Kind.KEY:
        return
    must_say = caller.shown.kind is not Kind.NOTHING
    if is_foreign(scope["scheme"], scope["headers"], must_say):
        raise not_this_site()


def caller_of(request: Request) -> Caller:
    """Who sends a request."""
    caller: Caller = request.scope["state"][CALLER]
    return caller


async def require_declared(request: Request) -> None:
    """Answer 401 or 403 to who lacks what a route needs; a dependency of all routes.

    Raises
    ------
    ProblemError
        If nobody in particular asks, or the role or the units of who does are not enough.
    """
    operation = f"{request.method} {request.scope['route'].path}"
    needed = request.app.declared[operation].needs
    if needed.permission is None:
        return
    identity = caller_of(request).identity
    if identity is None:
        raise not_logged_in()
    if identity.must_change_password and operation != CHANGE_PASSWORD:
        raise must_change_password()
    if not identity.role.may(needed.permission):
        raise not_allowed() if identity.is_proven else not_logged_in()
    unit = _unit_of(request.path_params)
    if needed.reach is Reach.ASKED:
        unit = _unit_asked(request)
    if unit is None and needed.reach is not Reach.NO_UNIT and identity.units:
        raise not_this_unit()
    if not identity.may(needed.permission, unit):
        raise not_this_unit()


def identity_of(request: Request) -> Identity:
    """Who sends a request that has passed `require_declared`."""
    identity = caller_of(request).identity
    if identity is None:
        raise not_logged_in()
    return identity


def _unit_of(parameters: Mapping[str, str]) -> str | None:
    """Which unit a path is about."""
    if "unit" in parameters:
        return parameters["unit"]
    if "alarm" in parameters:
        return parameters["alarm"].partition(":")[0]
    return None


def _unit_asked(request: Request) -> str | None:
    """The unit that is asked for; of two it is not guessed which."""
    units = request.query_params.getlist("unit")
    return units[0] if len(units) == 1 else None
