"""Error answers of the API: problem documents (RFC 9457)."""

import json
from collections.abc import Iterable, Mapping
from typing import Any

import structlog
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import Response
from pydantic import Field
from starlette.exceptions import HTTPException

from core.alarms.operation import ActionRefusedError
from service.api.auth.passwords import PasswordRefusedError
from service.live.alarm_list import UnknownAlarmError
from service.live.commands import (
    BaselineRefusedError,
    CommandFailedError,
    NotAvailableError,
    ReferenceRefusedError,
)
from service.recordings.motion import NoMotionError
from service.runtime.models import ValueModel
from service.store.access.identities import NameRefusedError
from service.store.access.tables import AccessRefusedError, UnknownAccountError
from service.store.port import QueryTooLargeError, StoreError

PROBLEM = "problem"
"""Key under which the ``state`` of an ASGI scope contains the `ProblemError` of the answer."""

MEDIA_TYPE = "application/problem+json"

MAX_BYTES = 2048
"""Maximum size of a problem document, bytes, so that wrong requests cause no large answers."""

MAX_MISTAKES = 8
"""Maximum number of wrong parameters in a problem document."""

SCHEMAS = "#/components/schemas/"

STORE_FAILS = "the store cannot be read now; try again, or see the log of the service"

WORDS = {
    401: "Not authenticated",
    403: "Not allowed, or requested by a page of another site",
    404: "Unknown unit or bearing",
    409: "Conflict with the present state",
    410: "Damaged on the disk",
    422: "A wrong parameter",
    503: "The store cannot be used",
}
"""Default descriptions of problems in the OpenAPI document, by status."""

OF_PYDANTIC = {
    "missing": "required, but missing",
    "extra_forbidden": "not a member of this request",
    "string_pattern_mismatch": "wrong format; /docs shows an example",
}
"""Descriptions of mistakes, by error type of pydantic, in place of pydantic's own."""

OF_FASTAPI = {
    400: ("Invalid body", "the body must be JSON in UTF-8"),
    404: ("Unknown address", "there is no such address; /docs lists all"),
}
"""Titles and details of problems that FastAPI finds, by status, in place of FastAPI's own."""

REFUSALS: Mapping[type[Exception], tuple[int, str, str | None]] = {
    ActionRefusedError: (409, "Conflict", None),
    BaselineRefusedError: (409, "Conflict", None),
    ReferenceRefusedError: (409, "No reference", None),
    NoMotionError: (409, "No samples", None),
    NotAvailableError: (409, "Not available here", None),
    NameRefusedError: (422, "Wrong parameter", "name"),
    PasswordRefusedError: (422, "Wrong parameter", "password"),
    UnknownAlarmError: (404, "Unknown alarm", None),
    UnknownAccountError: (404, "Unknown account", None),
    AccessRefusedError: (409, "Conflict", None),
}
"""Status, title and wrong parameter of the problem by error; the error's message is its detail."""

log = structlog.get_logger()


class Mistake(ValueModel):
    """Description of a wrong parameter of a request."""

    parameter: str = Field(description="Name of the parameter.", examples=["max_points"])
    detail: str = Field(
        description="What is wrong with the value.",
        examples=["Input should be less than or equal to 5000"],
    )


class Problem(ValueModel):
    """Problem document (RFC 9457)."""

    type: str = Field(
        default="about:blank",
        description="URI of the kind of problem; always `about:blank`.",
        examples=["about:blank"],
    )
    title: str = Field(description="Kind of problem.", examples=["Unknown unit"])
    status: int = Field(description="HTTP status.", examples=[404])
    detail: str = Field(description="Description of this problem.", examples=["unknown unit 'U9'"])
    instance: str = Field(description="Path of the request.", examples=["/api/v1/units/U9"])
    errors: list[Mistake] = Field(
        description="Wrong parameters; at most the first few.", default_factory=list
    )


class ProblemError(Exception):
    """Error that is answered with a problem document.

    Parameters
    ----------
    title, detail
        Kind of the problem, and description of this problem.
    parameter
        Name of the wrong parameter; None if no single parameter is wrong.
    headers
        Additional headers of the answer.
    errors
        Wrong parameters, if there may be several.
    """

    def __init__(
        self,
        status: int,
        title: str,
        detail: str,
        parameter: str | None = None,
        headers: Mapping[str, str] | None = None,
        errors: Iterable[Mistake] = (),
    ) -> None:
        super().__init__(detail)
        self.status, self.title, self.detail, self.headers = status, title, detail, headers
        self.errors = [Mistake(parameter=parameter, detail=detail)] if parameter else [*errors]


BEARER_ONLY = {"WWW-Authenticate": 'Bearer realm="padwatch"'}
"""Header of answers with status 401; the scheme Bearer opens no login dialog in browsers."""


def not_logged_in(detail: str = "log in, or send a valid API key") -> ProblemError:
    """Return the error with status 401 for an unauthenticated request or a failed login."""
    return ProblemError(401, "Not logged in", detail, headers=BEARER_ONLY)


def _documented(words: str) -> dict[str, Any]:
    content = {"schema": {"$ref": f"{SCHEMAS}Problem"}}
    return {"description": words, "content": {MEDIA_TYPE: content}}


EVERY_OPERATION: dict[int | str, dict[str, Any]] = {
    422: _documented(WORDS[422]),
    "default": _documented("Any other problem"),
}
"""OpenAPI entries for problems that every operation may return, by status."""


def problem_responses(
    *statuses: int, own: Mapping[int, str] | None = None
) -> dict[int | str, dict[str, Any]]:
    """Return OpenAPI entries for the problems that an operation may return, by status.

    `describe` adds 401, 403, 503, and 404 below a unit; `EVERY_OPERATION` has 422.
    `statuses` are described by `WORDS`; `own` has further statuses with their descriptions.
    """
    words = {status: WORDS[status] for status in statuses} | dict(own or {})
    return {status: _documented(text) for status, text in words.items()}


async def refuse_unknown_parameters(request: Request) -> None:
    """Reject a request body or query parameter that the route does not have.

    Raises `ProblemError` for a body, or for the first unknown parameter; the message lists the
    known parameters.
    """
    route = request.scope["route"]
    length = request.headers.get("content-length", "0")
    has_body = length != "0" or "transfer-encoding" in request.headers
    if route.body_field is None and has_body:
        raise ProblemError(400, "Unexpected body", "this request takes no body; omit it")
    operation = f"{request.method} {route.path}"
    known = request.app.declared[operation].query_parameters
    for name in request.query_params:
        if name not in known:
            detail = f"unknown parameter {name!r}; known parameters: {', '.join(known) or 'none'}"
            raise ProblemError(422, "Wrong parameter", detail, name)


def problem_schemas() -> dict[str, Any]:
    """Return the JSON schemas of problem documents, by name."""
    schema = Problem.model_json_schema(ref_template=f"{SCHEMAS}{{model}}")
    return {**schema.pop("$defs"), "Problem": schema}


def install_problem_handlers(app: FastAPI) -> None:
    """Install an exception handler that renders all errors as problem documents.

    The server logs the traceback of an unknown error, which is answered with status 500.
    """

    async def answer(request: Request, error: Exception) -> Response:
        return problem_answer(request, error)

    expected = (ProblemError, HTTPException, RequestValidationError, StoreError, CommandFailedError)
    for kind in (*expected, QueryTooLargeError, *REFUSALS, Exception):
        app.add_exception_handler(kind, answer)


def _problem_of(request: Request, error: Exception) -> ProblemError:
    """Return the problem with which an error is answered."""
    if isinstance(error, HTTPException | RequestValidationError):
        methods = _allowed_methods(request)
        if methods and request.method not in methods:
            detail = f"method {request.method} is not allowed; use {' or '.join(methods)}"
            allow = {"Allow": ", ".join(methods)}
            return ProblemError(405, "Method not allowed", detail, headers=allow)
    match error:
        case ProblemError():
            return error
        case HTTPException(status_code=status, detail=text, headers=headers):
            return ProblemError(status, *OF_FASTAPI.get(status, (text, text)), headers=headers)
        case RequestValidationError():
            return _wrong_parameters(error)
        case QueryTooLargeError():
            both = [Mistake(parameter=name, detail=str(error)) for name in ("start", "end")]
            return ProblemError(422, "Range too large", str(error), errors=both)
        case StoreError():
            log.error("database query failed", path=request.url.path, reason=str(error))
            return ProblemError(503, "Store not available", STORE_FAILS)
        case CommandFailedError():
            return ProblemError(503, error.title, str(error))
    for kind, (status, title, parameter) in REFUSALS.items():
        if isinstance(error, kind):
            return ProblemError(status, title, str(error), parameter)
    detail = "padwatch has failed; see the log of the service"
    return ProblemError(500, "Internal error", detail)


def _allowed_methods(request: Request) -> list[str]:
    """Return the allowed HTTP methods of a path; an empty list for an unknown path.

    If several path templates match, such as `/x/{version}` and `/x/freeze`, the template with
    the fewest parameters applies.
    """
    path, operations = request.scope["path"], request.app.declared.values()
    fitting = [operation for operation in operations if operation.matches(path)]
    n_parameters = min((operation.path.count("{") for operation in fitting), default=0)
    return sorted({each.method for each in fitting if each.path.count("{") == n_parameters})


def _wrong_parameters(error: RequestValidationError) -> ProblemError:
    found = error.errors()
    mistakes = [
        Mistake(
            parameter=".".join(str(p) for p in e["loc"][1:]),
            detail=OF_PYDANTIC.get(e["type"], str(e["msg"]).removeprefix("Value error, ")),
        )
        for e in found[:MAX_MISTAKES]
    ]
    detail = "; ".join(f"{mistake.parameter}: {mistake.detail}" for mistake in mistakes)
    if len(found) > MAX_MISTAKES:
        detail += f"; and {len(found) - MAX_MISTAKES} more"
    return ProblemError(422, "Wrong parameter", detail, errors=mistakes)


def problem_answer(request: Request, error: Exception) -> Response:
    """Return the response to a request with the problem document of an error.

    Texts are truncated so that the document stays within `MAX_BYTES`.
    """
    found, n_characters = _problem_of(request, error), 16 * MAX_BYTES  # as good as unlimited
    request.scope.setdefault("state", {})[PROBLEM] = found  # for the audit entry of a refusal
    while len(body := _document(found, request.scope["path"], n_characters)) > MAX_BYTES:
        n_characters = min(n_characters, MAX_BYTES) // 2
    return Response(body, found.status, found.headers, media_type=MEDIA_TYPE)


def _document(error: ProblemError, path: str, n_characters: int) -> bytes:
    """Return a problem document as JSON, with texts of at most `n_characters` or a part of it."""
    problem = Problem(
        title=_cut(error.title, n_characters // 4),
        status=error.status,
        detail=_cut(error.detail, n_characters),
        instance=_cut(path, n_characters // 4),
        errors=[
            Mistake(
                parameter=_cut(mistake.parameter, n_characters // 16),
                detail=_cut(mistake.detail, n_characters // 8),
            )
            for mistake in error.errors
        ],
    )
    return json.dumps(problem.model_dump(), ensure_ascii=False).encode("utf-8", "replace")


def _cut(text: str, n_characters: int) -> str:
    return text if len(text) <= n_characters else f"{text[:n_characters]}…"
