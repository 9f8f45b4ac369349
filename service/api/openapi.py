"""Additions to the OpenAPI document: operation ids, headers, required permissions."""

from collections.abc import Mapping
from typing import Any

from fastapi.routing import APIRoute

from service.api.answers import EDITION_HEADER, JSON, ORIGIN_HEADER, TIME_HEADER
from service.api.auth.authenticator import COOKIE
from service.api.auth.declared import Declared
from service.api.problems import WORDS, problem_schemas


def header(description: str, example: Any, kind: str = "string", **limits: Any) -> dict[str, Any]:
    """Return the OpenAPI entry of a header; `limits` are further members of its schema."""
    return {
        "description": description,
        "schema": {"type": kind, **limits},
        "example": example,
    }


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


def describe_answers(document: dict[str, Any]) -> None:
    """Add schemas of problems, headers and entity tags to an OpenAPI document, which is changed."""
    document.setdefault("components", {}).setdefault("schemas", {}).update(problem_schemas())
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            if path.startswith("/api/"):
                _add_headers(operation)
            if method == "get" and path.startswith("/api/"):
                _add_tags(operation)


def operation_id(route: APIRoute) -> str:
    """Return the operation id of a route, such as ``get_units_unit_bearings``."""
    path = route.path_format.removeprefix("/api/v1/").strip("/")
    [method] = route.methods or {""}
    return f"{method.lower()}_{path.translate(str.maketrans('/-.', '___', '{}'))}"


def _add_headers(operation: dict[str, Any]) -> None:
    for status, answer in operation["responses"].items():
        common = HEADERS if status.startswith("2") else PROBLEM_HEADERS.get(status, {})
        if common:
            answer["headers"] = {**common, **answer.get("headers", {})}


def _add_tags(operation: dict[str, Any]) -> None:
    answer = operation["responses"]["200"]
    if JSON in answer.get("content", {}):
        operation.setdefault("parameters", []).append(IF_NONE_MATCH)
        operation["responses"]["304"] = NOT_MODIFIED
        answer["headers"] = {"ETag": ETAG, **answer["headers"]}


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

NEEDED = "x-padwatch-needs"
"""OpenAPI extension with the permission that an operation requires; null if it is open."""


def describe_access(document: dict[str, Any], operations: Mapping[str, Declared]) -> None:
    """Add security schemes, required permissions and refusals to the given OpenAPI document."""
    document.setdefault("components", {})["securitySchemes"] = SCHEMES
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            one = operations[f"{method.upper()} {path}"]
            operation[NEEDED] = one.needs.permission
            operation["security"] = [] if one.is_open else [{"session": []}, {"key": []}]
            statuses = () if one.is_open else (401, 403, 503)
            responses = operation["responses"]
            for status in (*statuses, *((404,) if "{unit}" in path else ())):
                words = {"description": WORDS[status]}
                responses.setdefault(str(status), {**responses["default"], **words})
