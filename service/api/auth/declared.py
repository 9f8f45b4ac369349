"""Permissions that routes declare; the service does not start if a declaration is missing."""

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
    """Units that a route concerns if its path contains none."""

    PLANT = "plant"
    """All units; refused to a key of some units."""

    NO_UNIT = "no_unit"
    """No unit."""

    ASKED = "asked"
    """The unit of the parameter ``unit``; all units without it."""


@dataclass(frozen=True)
class Needs:
    """Permission and reach that a route requires; an open route requires no permission."""

    permission: Permission | None
    reach: Reach = Reach.PLANT

    async def __call__(self) -> None:
        """Do nothing; `service.api.auth.gate` enforces the declaration."""


def needs(permission: Permission, reach: Reach = Reach.PLANT) -> Any:
    """Declare the permission of a route, or of all routes of a router."""
    return Depends(Needs(permission, reach))


OPEN: Any = Depends(Needs(None, Reach.NO_UNIT))
"""Declares an open route."""


def subject_router(
    path: str, tag: str, permission: Permission = Permission.READ, reach: Reach = Reach.PLANT
) -> APIRouter:
    """Return a router for one subject; a single route may declare another permission."""
    return APIRouter(prefix=f"/api/v1{path}", tags=[tag], dependencies=[needs(permission, reach)])


class UndeclaredRouteError(Exception):
    """A route without a declaration; the message names it."""


@dataclass(frozen=True)
class Declared:
    """A route with its requirements."""

    method: str
    path: str
    route: BaseRoute
    needs: Needs

    @property
    def operation(self) -> str:
        """Method and path."""
        return f"{self.method} {self.path}"

    @property
    def is_open(self) -> bool:
        """Whether the route is open."""
        return self.needs.permission is None

    @cached_property
    def query_parameters(self) -> Sequence[str]:
        """Names of its query parameters."""
        if not isinstance(self.route, APIRoute):
            return ()
        return tuple(dict.fromkeys(_query_names(self.route.dependant)))

    def matches(self, path: str) -> bool:
        """Whether a path matches the route."""
        return isinstance(self.route, Route) and self.route.path_regex.match(path) is not None


def declared(app: FastAPI) -> Mapping[str, Declared]:
    """Return the requirements of each operation of an application, by method and path.

    Raises
    ------
    UndeclaredRouteError
        If a route has no declaration. The declaration of a route overrides that of its router.
    """
    found: dict[str, Declared] = {}
    for one in _all(app):
        if one.operation in found:
            raise UndeclaredRouteError(f"{one.operation}: there are two such operations")
        found[one.operation] = one
    return found


def allowed_methods(operations: Iterable[Declared], path: str) -> list[str]:
    """Return the methods of a path; none for an unknown path.

    Of two matching templates, such as `/x/{version}` and `/x/freeze`, the one with fewer
    parameters counts.
    """
    fitting = [operation for operation in operations if operation.matches(path)]
    n_parameters = min((operation.path.count("{") for operation in fitting), default=0)
    return sorted({each.method for each in fitting if each.path.count("{") == n_parameters})


def _all(app: FastAPI) -> Iterator[Declared]:
    for context in iter_route_contexts(app.routes):
        route = context.original_route
        path = str(context.path)
        for method in sorted(context.methods or ()) or ("?",):
            yield Declared(method, path, route, _needs_of(app, method, path, context, route))


def _needs_of(app: FastAPI, method: str, path: str, context: Any, route: BaseRoute) -> Needs:
    if isinstance(route, Route) and not isinstance(route, APIRoute) and path == app.openapi_url:
        return Needs(None, Reach.NO_UNIT)
    found = _needs_in(context.dependencies) if isinstance(route, APIRoute) else []
    if not found:
        raise UndeclaredRouteError(f"{method} {path}: declares no permission; add needs() or OPEN")
    return found[-1]


def _needs_in(dependencies: Sequence[Any]) -> list[Needs]:
    return [each.dependency for each in dependencies if isinstance(each.dependency, Needs)]


def _query_names(dependant: Dependant) -> Iterator[str]:
    """Yield the names of query parameters of an operation and of its dependencies."""
    for field in dependant.query_params:
        yield field.alias
    for inner in dependant.dependencies:
        yield from _query_names(inner)
