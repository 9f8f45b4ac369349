"""What the published description says of every operation alike: names, tags, headers, examples."""

from typing import Any

from service.api.edition import HEADER as EDITION_HEADER
from service.api.examples import Examples
from service.api.origin_header import HEADER as ORIGIN_HEADER
from service.api.problems import problem_schemas
from service.api.revalidation import TIME_HEADER

JSON = "application/json"

IF_NONE_MATCH: dict[str, Any] = {
    "name": "If-None-Match",
    "in": "header",
    "required": False,
    "description": "`ETag` of an answer that is still there: 304 if nothing is new since.",
    "schema": {"type": "string"},
    "example": 'W/"1f2e3d4c5b6a79880716253f"',
}

ETAG = {
    "description": "Names what the answer says; ages and the present time count for nothing.",
    "schema": {"type": "string"},
    "example": IF_NONE_MATCH["example"],
}

HEADERS = {
    TIME_HEADER: {
        "description": "When it was given: by it, ages in an answer that was kept are counted on.",
        "schema": {"type": "string"},
        "example": "2026-11-21T09:03:12.400Z",
    },
    ORIGIN_HEADER: {
        "description": "Whether it is about now or played from a recording.",
        "schema": {"type": "string", "enum": ["live", "replay"]},
        "example": "live",
    },
    EDITION_HEADER: {
        "description": "Which program gave it: another one after an upgrade.",
        "schema": {"type": "string"},
        "example": "1.0.0-1f2e3d4c",
    },
}
"""Of every answer of the API."""

OF_REFUSALS: dict[str, dict[str, Any]] = {
    "401": {
        "WWW-Authenticate": {
            "description": "How a machine shows who it is.",
            "schema": {"type": "string"},
            "example": 'Bearer realm="padwatch"',
        }
    },
    "429": {
        "Retry-After": {
            "description": "Seconds to wait.",
            "schema": {"type": "integer"},
            "example": 4,
        }
    },
}
"""What some problems say beside their document."""

NOT_MODIFIED = {
    "description": "Nothing is new since the answer of that `ETag`",
    "headers": {"ETag": ETAG, **HEADERS},
}


def describe_answers(document: dict[str, Any]) -> None:
    """Complete a description with what every operation has in common."""
    schemas = document.setdefault("components", {}).setdefault("schemas", {})
    schemas.update(problem_schemas())
    examples = Examples(schemas)
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            operation["operationId"] = operation_id(method, path)
            _add_examples(operation, examples)
            if path.startswith("/api/"):
                _add_headers(operation)
            if method == "get" and path.startswith("/api/"):
                _add_tags(operation)


def operation_id(method: str, path: str) -> str:
    """Name of an operation, such as ``get_units_unit_bearings``: as lasting as its address."""
    words = path.removeprefix("/api/v1/").strip("/").translate(str.maketrans("/-.", "___", "{}"))
    return f"{method}_{words}"


def _add_examples(operation: dict[str, Any], examples: Examples) -> None:
    answers = [said for status, said in operation["responses"].items() if status.startswith("2")]
    for told in (*answers, operation.get("requestBody", {})):
        content = told.get("content", {}).get(JSON)
        if content and "schema" in content and not {"example", "examples"} & set(content):
            content["example"] = examples.of(content["schema"])


def _add_headers(operation: dict[str, Any]) -> None:
    for status, answer in operation["responses"].items():
        common = HEADERS if status.startswith("2") else OF_REFUSALS.get(status, {})
        if common:
            answer["headers"] = {**common, **answer.get("headers", {})}


def _add_tags(operation: dict[str, Any]) -> None:
    answer = operation["responses"]["200"]
    if JSON in answer.get("content", {}):
        operation.setdefault("parameters", []).append(IF_NONE_MATCH)
        operation["responses"]["304"] = NOT_MODIFIED
        answer["headers"] = {"ETag": ETAG, **answer["headers"]}
