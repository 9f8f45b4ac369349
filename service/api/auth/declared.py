"""Declaration of the permission that a route requires; a route without one is an error."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Any

from fastapi import APIRouter, Depends, FastAPI
from fastapi.dependencies.models import Dependant
from fastapi.routing import APIRoute, iter_route_contexts
from starlette.routing import BaseRoute, Route

from service.store.access.identities import Permission


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
        """Do nothing as a dependency; `service.api.auth.gate` checks the permission."""


def needs(permission: Permission, reach: Reach = Reach.PLANT) -> Any:
    """Return a FastAPI dependency that declares the requirements of a route or router."""
    return Depends(Needs(permission, reach))


OPEN: Any = Depends(Needs(None, Reach.NO_UNIT))
"""Dependency that declares an open route, which requires no login."""


def subject_router(
    path: str, tag: str, permission: Permission = Permission.READ, reach: Reach = Reach.PLANT
) -> APIRouter:
    """Return a router for paths below ``/api/v1`` that require a permission by default.

    `path` is the common start of the paths, `tag` their group in the OpenAPI document, and `reach`
    the units that a route concerns if its path contains no unit.
    """
    return APIRouter(prefix=f"/api/v1{path}", tags=[tag], dependencies=[needs(permission, reach)])


class UndeclaredRouteError(Exception):
    """Raised if a route declares neither permission nor `OPEN`, or if an operation occurs twice."""


@dataclass(frozen=True)
class Declared:
    """Operation of the API: HTTP method, path template, route and required permission."""

    method: str
    path: str
    route: BaseRoute
    needs: Needs

    @property
    def operation(self) -> str:
        """Name of the operation: method and path template, such as ``GET /livez``."""
        return f"{self.method} {self.path}"

    @property
    def is_open(self) -> bool:
        """Whether the operation requires no permission."""
        return self.needs.permission is None

    @cached_property
    def query_parameters(self) -> Sequence[str]:
        """Names of the query parameters of the operation, including those of its dependencies."""
        if not isinstance(self.route, APIRoute):
            return ()
        return tuple(dict.fromkeys(_query_names(self.route.dependant)))

    def matches(self, path: str) -> bool:
        """Whether a path matches the path template of the operation, for any HTTP method."""
        return isinstance(self.route, Route) and self.route.path_regex.match(path) is not None


def declared(app: FastAPI) -> Mapping[str, Declared]:
    """Return the operations of an application, by name (method and path template).

    The declaration of a route overrides the declaration of its router.

    Raises `UndeclaredRouteError` if a route has no declaration, or an operation occurs twice.
    """
    found: dict[str, Declared] = {}
    for context in iter_route_contexts(app.routes):
        route, path = context.original_route, str(context.path)
        for method in sorted(context.methods or ()) or ("?",):
            one = Declared(method, path, route, _needs_of(app, f"{method} {path}", context))
            if one.operation in found:
                detail = "the operation occurs twice; remove one"
                raise UndeclaredRouteError(f"{one.operation}: {detail}")
            found[one.operation] = one
    return found


def allowed_methods(operations: Iterable[Declared], path: str) -> list[str]:
    """Return the allowed HTTP methods of a path; an empty list for an unknown path.

    If several path templates match, such as `/x/{version}` and `/x/freeze`, the template with
    the fewest parameters applies.
    """
    fitting = [operation for operation in operations if operation.matches(path)]
    n_parameters = min((operation.path.count("{") for operation in fitting), default=0)
    return sorted({each.method for each in fitting if each.path.count("{") == n_parameters})


def _needs_of(app: FastAPI, operation: str, context: Any) -> Needs:
    if isinstance(context.original_route, APIRoute):
        found = [each.dependency for each in context.dependencies]
        if declarations := [each for each in found if isinstance(each, Needs)]:
            return declarations[-1]
    elif isinstance(context.original_route, Route) and context.path == app.openapi_url:
        return Needs(None, Reach.NO_UNIT)
    raise UndeclaredRouteError(f"{operation}: route without declaration; add needs(...) or OPEN")


def _query_names(dependant: Dependant) -> Iterator[str]:
    """Yield the names of the query parameters of an operation and of its dependencies."""
    for field in dependant.query_params:
        yield field.alias
    for inner in dependant.dependencies:
        yield from _query_names(inner)
