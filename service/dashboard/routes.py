"""Routes of the dashboard: one page, its files, and the chart library from its own package."""

from fastapi import APIRouter, HTTPException, Request, Response

from service.api.access.declared import OPEN
from service.dashboard.assets import Asset, pages, plotly

SECURITY_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:;"
        " object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
}
"""No script but our own files. Plotly adds style elements of its own, hence the inline styles."""

REVALIDATE = "no-cache"
"""A page from before an upgrade must never talk to the service from after it."""

KEEP_A_WEEK = "public, max-age=604800"
"""For the five megabytes of the chart library, which only change with its package."""


def dashboard_router() -> APIRouter:
    """Build the routes ``/``, ``/static/…`` and ``/static/plotly.min.js``."""
    router = APIRouter(include_in_schema=False, dependencies=[OPEN])
    router.add_api_route("/", _index, methods=["GET", "HEAD"])
    router.add_api_route("/static/plotly.min.js", _plotly, methods=["GET", "HEAD"])
    router.add_api_route("/static/{path:path}", _file, methods=["GET", "HEAD"])
    return router


# Plain functions: FastAPI runs them in a worker thread, away from the acquisition's event loop.


def _index(request: Request) -> Response:
    return _sent(pages()["index.html"], request, REVALIDATE)


def _plotly(request: Request) -> Response:
    return _sent(plotly(), request, KEEP_A_WEEK)


def _file(path: str, request: Request) -> Response:
    asset = pages().get(path)
    if asset is None:
        raise HTTPException(404, f"the dashboard has no file {path}")
    return _sent(asset, request, REVALIDATE)


def _sent(asset: Asset, request: Request, caching: str) -> Response:
    packed = "gzip" in request.headers.get("accept-encoding", "")
    etag = asset.etag.replace('"', '"gz-', 1) if packed else asset.etag
    headers = SECURITY_HEADERS | {"Cache-Control": caching, "ETag": etag, "Vary": "Accept-Encoding"}
    if etag in request.headers.get("if-none-match", ""):
        return Response(status_code=304, headers=headers)
    if packed:
        headers["Content-Encoding"] = "gzip"
    body = asset.gzipped if packed else asset.body
    return Response(body, headers=headers, media_type=asset.media_type)
