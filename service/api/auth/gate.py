"""Requirements of the routes, authentication of callers by middleware, and permission checks.

A route that declares no requirements is an error.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Any

from fastapi import APIRouter, Depends, FastAPI, Request
from fastapi.dependencies.utils import get_flat_params
from fastapi.params import Query
from fastapi.routing import APIRoute, iter_route_contexts
from starlette.types import ASGIApp, Receive, Scope, Send

from service.api.auth.authenticator import Authenticator
from service.api.auth.credentials import CALLER, Caller, is_foreign
from service.api.problems import (
    EVERY_OPERATION,
    PROBLEM,
    ProblemError,
    not_logged_in,
    problem_answer,
    refuse_unknown_parameters,
)
from service.store.access.audit_entries import Acting, Source, acting, acting_as, name_actor
from service.store.access.identities import LOCAL, Identity, Means, Permission
from service.store.port import StoreError


class Reach(StrEnum):
    """Units that a route concerns, if the path of the route contains no unit."""

    PLANT = "plant"
    """All units; an API key that is limited to some units is refused."""

    NO_UNIT = "no_unit"
    """No unit; an API key that is limited to some units can only read."""

    ASKED = "asked"
    """Unit of the query parameter ``unit``; all units if the parameter is absent."""


@dataclass(frozen=True)
class Needs:
    """Requirements of a route: permission, and units for which the permission must be valid.

    `permission` is None for an open route, which requires no login. `reach` are the units that the
    route concerns if its path contains no unit; by default all.
    """

    permission: Permission | None
    reach: Reach = Reach.PLANT

    async def __call__(self) -> None:
        """Do nothing as a dependency; `require_declared` checks the permission."""


def needs(permission: Permission, reach: Reach = Reach.PLANT) -> Any:
    """Return a FastAPI dependency that declares the requirements of a route or router."""
    return Depends(Needs(permission, reach))


OPEN: Any = Depends(Needs(None, Reach.NO_UNIT))
"""Dependency that declares an open route, which requires no login."""


class GuardedRouter(APIRouter):
    """Router whose routes a `GuardedApi` takes as they are; `options` are those of `APIRouter`.

    `include_router` of FastAPI 0.165 would build each route again, at half the cost of a start.
    """

    def __init__(self, dependencies: Sequence[Any] = (), **options: Any) -> None:
        super().__init__(
            dependencies=[Depends(require_declared), Depends(require_known), *dependencies],
            responses=EVERY_OPERATION,
            generate_unique_id_function=operation_id,
            **options,
        )


def operation_id(route: APIRoute) -> str:
    """Return the operation id of a route, such as ``get_units_unit_bearings``."""
    path = route.path_format.removeprefix("/api/v1/").strip("/")
    [method] = route.methods or {""}
    return f"{method.lower()}_{path.translate(str.maketrans('/-.', '___', '{}'))}"


def subject_router(
    path: str, tag: str, permission: Permission = Permission.READ, reach: Reach = Reach.PLANT
) -> GuardedRouter:
    """Return a router for paths below ``/api/v1`` that require a permission by default.

    `path` is the common start of the paths, `tag` their group in the OpenAPI document, and `reach`
    the units that a route concerns if its path contains no unit.
    """
    guard = [needs(permission, reach)]
    return GuardedRouter(prefix=f"/api/v1{path}", tags=[tag], dependencies=guard)


class UndeclaredRouteError(Exception):
    """Raised if a route declares neither permission nor `OPEN`, or if an operation occurs twice."""


@dataclass(frozen=True)
class Declared:
    """Operation of the API: HTTP method, path template, route and required permission."""

    method: str
    path: str
    route: APIRoute
    needs: Needs

    @property
    def is_open(self) -> bool:
        """Whether the operation requires no permission."""
        return self.needs.permission is None

    @cached_property
    def query_parameters(self) -> Sequence[str]:
        """Names of the query parameters of the operation, including those of its dependencies."""
        parameters = get_flat_params(self.route.dependant)
        return tuple(each.alias for each in parameters if isinstance(each.field_info, Query))

    def matches(self, path: str) -> bool:
        """Whether a path matches the path template of the operation, for any HTTP method."""
        return self.route.path_regex.match(path) is not None


def declared(app: FastAPI) -> Mapping[str, Declared]:
    """Return the operations of an application, by name (method and path template).

    The declaration of a route overrides the declaration of its router.

    Raises `UndeclaredRouteError` if a route has no declaration, or an operation occurs twice.
    """
    found: dict[str, Declared] = {}
    for context in iter_route_contexts(app.routes):
        route, path = context.original_route, str(context.path)
        dependencies = context.dependencies if isinstance(route, APIRoute) else ()
        stated = [each.dependency for each in dependencies if isinstance(each.dependency, Needs)]
        for method in sorted(context.methods or ()) or ("?",):
            operation = f"{method} {path}"
            if not isinstance(route, APIRoute) or not stated:
                detail = "route without declaration; add needs(...) or OPEN"
                raise UndeclaredRouteError(f"{operation}: {detail}")
            if operation in found:
                raise UndeclaredRouteError(f"{operation}: the operation occurs twice; remove one")
            found[operation] = Declared(method, path, route, stated[-1])
    return found


SAFE = ("GET", "HEAD", "OPTIONS")
"""Safe HTTP methods, which change no state."""

REFUSED = (401, 403, 409, 413, 422, 429)
"""HTTP statuses of refused requests."""

CHANGE_PASSWORD = "POST /api/v1/session/password"  # noqa: S105  an operation


class Gate:
    """ASGI middleware that authenticates callers, and protects routes that are not open.

    It adds the client address to audit entries, and records refused changes in the audit trail.
    """

    def __init__(self, app: ASGIApp, authenticator: Authenticator) -> None:
        self._app, self._desk = app, authenticator

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request with its caller in the state; answer 401, 403 or 503 if refused."""
        client, state = scope.get("client"), scope.setdefault("state", {})
        with acting_as(Acting(Source.API, str(client[0]) if client else None)):
            try:
                await self._admit(scope)
            except (ProblemError, StoreError) as error:
                await problem_answer(Request(scope), error)(scope, receive, send)
            else:
                await self._app(scope, receive, send)
            problem: ProblemError | None = state.get(PROBLEM)
            if problem and problem.status in REFUSED and scope["method"] not in SAFE:
                operation = f"{scope['method']} {scope['path']}"
                await self._desk.record_refusal(operation, problem.detail, problem.status)

    async def _admit(self, scope: Scope) -> None:
        caller = scope["state"][CALLER] = await self._desk.caller(scope)
        if caller.identity is None and not any(
            each.is_open and each.method == scope["method"] and each.matches(scope["path"])
            for each in scope["app"].declared.values()
        ):
            raise not_logged_in()
        means = caller.means
        may_be_forged = scope["method"] not in SAFE and means is not Means.KEY
        if may_be_forged and is_foreign(scope, requires_origin=means is not None):
            detail = "pages of other sites are refused; scripts must send a key, or Origin"
            raise ProblemError(403, "Cross-site request", detail)
        if caller.identity is not None and caller.identity.is_proven:
            name_actor(caller.identity.actor)


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
    identity = identity_of(request)
    if identity.must_change_password and operation != CHANGE_PASSWORD:
        detail = "an administrator set your password; change it before other requests"
        raise ProblemError(403, "Password change required", detail)
    if not identity.role.may(needed.permission):
        if identity.is_proven:
            raise ProblemError(403, "Not allowed", "your role does not permit this request")
        raise not_logged_in()
    unit = request.path_params.get("unit")
    if unit is None and "alarm" in request.path_params:
        unit = request.path_params["alarm"].partition(":")[0]
    if needed.reach is Reach.ASKED:
        units = request.query_params.getlist("unit")
        unit = units[0] if len(units) == 1 else None
    is_plant = unit is None and needed.reach is not Reach.NO_UNIT
    if (is_plant and identity.units) or not identity.may(needed.permission, unit):
        detail = "this key is limited to some units; request one of them"
        raise ProblemError(403, "Not allowed", detail)


def identity_of(request: Request) -> Identity:
    """Return the identity of the caller; raise `ProblemError` (401) without an identity."""
    identity = caller_of(request).identity
    if identity is None:
        raise not_logged_in()
    return identity


def actor_or(given: str | None) -> str:
    """Return the name of the actor: the authenticated name, else `given`, else `LOCAL`."""
    return acting().actor or given or LOCAL


async def name_caller(request: Request) -> None:
    """Set the caller as the actor of the audit entries of this request, also without a login.

    This is a coroutine, since FastAPI runs plain functions in threads with separate contexts.
    """
    name_actor(identity_of(request).actor)


async def require_known(request: Request) -> None:
    """Refuse parameters that a route does not have, and unknown units and bearings."""
    await refuse_unknown_parameters(request)
    match request.path_params:
        case {"unit": unit, "bearing": bearing}:
            request.app.state.context.bearing(unit, bearing)
        case {"unit": unit}:
            request.app.state.context.unit(unit)
