"""HTTP application of the service: routers, middleware, and the OpenAPI document."""

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from importlib.metadata import version
from threading import Lock
from typing import Any

from fastapi import Depends, FastAPI, Request, Response
from starlette.types import ASGIApp

from service.api.answers import (
    EDITION_HEADER,
    JSON,
    ORIGIN_HEADER,
    TIME_HEADER,
    AnswerHeaders,
    Repetition,
)
from service.api.auth.accounts import access_router
from service.api.auth.credentials import COOKIE
from service.api.auth.gate import (
    OPEN,
    Declared,
    Gate,
    GuardedRouter,
    declared,
    operation_id,
    require_declared,
)
from service.api.auth.sessions import session_router
from service.api.context import Context
from service.api.health import RequestMetrics, health_router
from service.api.problems import (
    EVERY_OPERATION,
    WORDS,
    install_problem_handlers,
    problem_schemas,
)
from service.api.routes.alarm_rates import alarm_rate_router
from service.api.routes.alarms import alarm_router, operation_router
from service.api.routes.audit import audit_router
from service.api.routes.baselines import baseline_router
from service.api.routes.bearings import bearing_router
from service.api.routes.channels import channel_router
from service.api.routes.film_history import film_history_router
from service.api.routes.films import film_router
from service.api.routes.motion import motion_router
from service.api.routes.overview import overview_router
from service.api.routes.plant import plant_router
from service.api.routes.recordings import recording_router
from service.api.routes.spectra import spectra_router
from service.api.routes.trends import trend_router


def header(description: str, example: Any, kind: str = "string", **limits: Any) -> dict[str, Any]:
    """Return the OpenAPI entry of a header.

    `kind` is the JSON type of its value; `limits` are further members of its schema.
    """
    return {"description": description, "schema": {"type": kind, **limits}, "example": example}


TAG = 'W/"1f2e3d4c5b6a79880716253f"'

IF_NONE_MATCH: dict[str, Any] = {
    "name": "If-None-Match",
    "in": "header",
    "required": False,
    **header("`ETag` of a cached answer: 304 if it is unchanged.", TAG),
}

ETAG = header("Entity tag of the content, for `If-None-Match`.", TAG)

HEADERS = {
    TIME_HEADER: header(
        "Time of the answer, from which clients compute ages.", "2026-11-21T09:03:12.400Z"
    ),
    ORIGIN_HEADER: header("Live data or replay of a recording.", "live", enum=["live", "replay"]),
    EDITION_HEADER: header("Version of the program; changes with an upgrade.", "1.0.0-1f2e3d4c"),
}
"""OpenAPI entries for the headers of successful answers, by name of the header."""

PROBLEM_HEADERS: dict[str, dict[str, Any]] = {
    "401": {"WWW-Authenticate": header("How a machine authenticates.", 'Bearer realm="padwatch"')},
    "429": {"Retry-After": header("Time to wait before the next request, s.", 4, "integer")},
}
"""OpenAPI entries for the headers of problems, by status."""

NOT_MODIFIED = {
    "description": "Unchanged since the answer of that `ETag`",
    "headers": {"ETag": ETAG, **HEADERS},
}


SCHEMES = {
    "session": {
        "type": "apiKey",
        "in": "cookie",
        "name": COOKIE,
        "description": "Session cookie of a person (POST /api/v1/session).",
    },
    "key": {
        "type": "http",
        "scheme": "bearer",
        "description": "API key of a machine (padwatch keys create).",
    },
}


def describe(document: dict[str, Any], operations: Mapping[str, Declared]) -> None:
    """Complete an OpenAPI document in place: access, problems, headers and entity tags.

    `operations` are the operations of the application by name (method and path template).
    """
    components = document.setdefault("components", {})
    components["securitySchemes"] = SCHEMES
    components.setdefault("schemas", {}).update(problem_schemas())
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            one, answers = operations[f"{method.upper()} {path}"], operation["responses"]
            operation["x-padwatch-needs"] = one.needs.permission  # null if it is open
            operation["security"] = [] if one.is_open else [{"session": []}, {"key": []}]
            statuses = () if one.is_open else (401, 403, 503)
            for status in (*statuses, *((404,) if "{unit}" in path else ())):
                words = {"description": WORDS[status]}
                answers.setdefault(str(status), {**answers["default"], **words})
            if not path.startswith("/api/"):
                continue
            for code, answer in answers.items():
                common = HEADERS if code.startswith("2") else PROBLEM_HEADERS.get(code, {})
                if common:
                    answer["headers"] = {**common, **answer.get("headers", {})}
            if method == "get" and JSON in answers["200"].get("content", {}):
                operation.setdefault("parameters", []).append(IF_NONE_MATCH)
                answers["304"] = NOT_MODIFIED
                answers["200"]["headers"] = {"ETag": ETAG, **answers["200"]["headers"]}


Repeating = Callable[[ASGIApp, Iterable[tuple[str, str]]], ASGIApp]


class GuardedApi(FastAPI):
    """FastAPI application in which every route declares the permission that it requires.

    `options` are keyword arguments of `FastAPI`, whose own pages load scripts from other sites.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(dependencies=[Depends(require_declared)], openapi_url=None, **options)
        self.declared: Mapping[str, Declared] = {}
        """Operations with their required permissions, by method and path such as ``GET /livez``."""
        self.repeating: Repeating | None = None
        """Function that puts the whole application with its server's headers into `Repetition`."""
        self._describing = Lock()

    def openapi(self) -> dict[str, Any]:
        """Return the OpenAPI document, built at the first call, after all routes were added.

        Concurrent callers wait until the document is complete.
        """
        with self._describing:
            if self.openapi_schema is None:
                document: dict[str, Any] = super().openapi()
                describe(document, self.declared)
            return self.openapi_schema or {}


DESCRIPTION = """
Oil-film stiffness of hydrogenerator guide bearings, measured while the machine runs.

Numbers that cannot be known are `null` with a `level` and a `reason`. Amplitudes are zero-to-peak.
Times are UTC, RFC 3339. Errors are problem documents (RFC 9457).
"""


def create_app(context: Context, others: Iterable[GuardedRouter] = ()) -> GuardedApi:
    """Return the application of the API; `others` are routers of other packages."""
    app = GuardedApi(
        title="padwatch",
        version=version("padwatch"),
        description=DESCRIPTION,
        responses=EVERY_OPERATION,
        generate_unique_id_function=operation_id,
    )
    app.state.clock, app.state.context = context.clock, context
    authenticator, requests = context.access, RequestMetrics()
    app.repeating = partial(
        Repetition,
        answers=context.answers,
        caller=authenticator.caller,
        observe=requests.observe,
        clock=context.clock,
    )
    # the last one runs first
    app.add_middleware(AnswerHeaders, clock=context.clock)
    app.add_middleware(Gate, authenticator=authenticator)
    app.add_middleware(requests.timed)
    install_problem_handlers(app)

    @app.api_route(
        "/api/v1/openapi.json",
        methods=["GET", "HEAD"],
        operation_id="openapi",
        include_in_schema=False,
        dependencies=[OPEN],
    )
    async def document(request: Request) -> Response:
        """Return the OpenAPI document, which is rendered once, not for each request."""
        return await context.answers.of(request, lambda: 0, app.openapi)

    routers: tuple[GuardedRouter, ...] = (
        # routes are tried in this order: first those that every open page polls
        overview_router(context),
        alarm_rate_router(context),
        alarm_router(context),
        trend_router(context),
        bearing_router(context),
        plant_router(context),
        channel_router(context),
        spectra_router(context),
        motion_router(context),
        health_router(context, requests),
        film_router(context),
        film_history_router(context),
        baseline_router(context),
        operation_router(context),
        recording_router(context),
        audit_router(context),
        session_router(authenticator),
        access_router(context, authenticator),
        *others,
    )
    for router in routers:
        app.router.routes += router.routes
    app.declared = declared(app)  # raises an error for a route without a declaration
    return app
