"""A route that does not say what it needs keeps the service from starting."""

import pytest
from fastapi import APIRouter, FastAPI
from starlette.responses import PlainTextResponse
from starlette.routing import Mount

from service.api.access.application import GuardedApi
from service.api.access.declared import OPEN, Reach, UndeclaredRouteError, declared, needs
from service.security.roles import Permission


def test_a_route_without_a_declaration_is_refused_by_its_name() -> None:
    app = GuardedApi(openapi_url=None)
    router = APIRouter(prefix="/things")
    router.add_api_route("/{thing}", lambda thing: thing, methods=["PUT"])
    app.include_router(router)

    with pytest.raises(UndeclaredRouteError, match=r"^PUT /things/\{thing\}: "):
        app.require_declarations()


def test_what_is_no_operation_or_two_of_one_name_is_refused() -> None:
    app = FastAPI(openapi_url=None, routes=[Mount("/files", PlainTextResponse("all of them"))])
    two = FastAPI(openapi_url=None)
    for _ in range(2):
        two.add_api_route("/thing", lambda: None, dependencies=[OPEN])

    with pytest.raises(UndeclaredRouteError, match="/files"):
        declared(app)
    with pytest.raises(UndeclaredRouteError, match="two"):
        declared(two)


def test_a_routes_own_declaration_counts_before_its_routers() -> None:
    app = FastAPI(openapi_url=None)
    router = APIRouter(dependencies=[needs(Permission.READ)])
    router.add_api_route("/a", lambda: None)
    router.add_api_route("/b", lambda: None, dependencies=[needs(Permission.CHANGE_ACCESS)])
    router.add_api_route("/c", lambda: None, dependencies=[OPEN])
    app.include_router(router)
    found = declared(app)

    assert found["GET /a"].needs.permission is Permission.READ
    assert found["GET /a"].needs.reach is Reach.PLANT
    assert found["GET /b"].needs.permission is Permission.CHANGE_ACCESS
    assert [found[name].is_open for name in ("GET /a", "GET /b", "GET /c")] == [False, False, True]
