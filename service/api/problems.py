"""Every error as a problem document (RFC 9457), whoever raised it."""

from collections.abc import Sequence
from typing import Any

import structlog
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel, Field
from starlette.exceptions import HTTPException

from service.store.port import QueryTooLargeError, StoreError

MEDIA_TYPE = "application/problem+json"

log = structlog.get_logger()


class Mistake(BaseModel):
    """One wrong parameter of a request."""

    parameter: str = Field(examples=["max_points"])
    detail: str = Field(examples=["Input should be less than or equal to 5000"])


class Problem(BaseModel):
    """A problem document (RFC 9457)."""

    type: str = Field(default="about:blank", examples=["about:blank"])
    title: str = Field(examples=["Unknown unit"])
    status: int = Field(examples=[404])
    detail: str = Field(examples=["there is no unit 'U9' in this plant"])
    instance: str = Field(examples=["/api/v1/units/U9"])
    errors: list[Mistake] = Field(default_factory=list)


class ProblemError(Exception):
    """Ends a request with a problem document."""

    def __init__(self, status: int, title: str, detail: str, parameter: str | None = None) -> None:
        super().__init__(detail)
        self.status, self.title, self.detail = status, title, detail
        self.errors = [Mistake(parameter=parameter, detail=detail)] if parameter else []


def problem_responses(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """OpenAPI entries for the problems that an operation may answer with."""
    content = {MEDIA_TYPE: {"schema": Problem.model_json_schema()}}
    words = {404: "Unknown unit or bearing", 409: "No result yet", 422: "A wrong parameter"}
    return {status: {"description": words[status], "content": content} for status in statuses}


def install_problem_handlers(app: FastAPI) -> None:
    """Render all errors of an application as problem documents."""

    @app.exception_handler(ProblemError)
    async def _problem(request: Request, error: ProblemError) -> JSONResponse:
        return _render(request, error.status, error.title, error.detail, error.errors)

    @app.exception_handler(HTTPException)
    async def _http(request: Request, error: HTTPException) -> JSONResponse:
        return _render(request, error.status_code, str(error.detail), str(error.detail))

    @app.exception_handler(RequestValidationError)
    async def _validation(request: Request, error: RequestValidationError) -> JSONResponse:
        mistakes = [
            Mistake(parameter=".".join(str(p) for p in e["loc"][1:]), detail=str(e["msg"]))
            for e in error.errors()
        ]
        detail = "; ".join(f"{mistake.parameter}: {mistake.detail}" for mistake in mistakes)
        return _render(request, 422, "Wrong parameter", detail, mistakes)

    @app.exception_handler(QueryTooLargeError)
    async def _too_large(request: Request, error: QueryTooLargeError) -> JSONResponse:
        mistakes = [Mistake(parameter=name, detail=str(error)) for name in ("start", "end")]
        return _render(request, 422, "Range too large", str(error), mistakes)

    @app.exception_handler(StoreError)
    async def _store(request: Request, error: StoreError) -> JSONResponse:
        log.error("a query failed in the store", path=request.url.path, reason=str(error))
        return _render(request, 503, "Store not available", "the store cannot be read just now")


def _render(
    request: Request, status: int, title: str, detail: str, errors: Sequence[Mistake] = ()
) -> JSONResponse:
    problem = Problem(
        title=title,
        status=status,
        detail=detail,
        instance=request.url.path,
        errors=list(errors),
    )
    return JSONResponse(problem.model_dump(), status, media_type=MEDIA_TYPE)
