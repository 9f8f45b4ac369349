"""Routes of the dashboard: the page, its static files, and the chart library."""

from functools import cache

from fastapi import APIRouter, HTTPException, Request, Response

from service.api.auth.declared import OPEN
from service.dashboard.assets import Asset, edition, pages, plotly

SECURITY_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:;"
        " object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
}
"""Security headers: scripts from this server only; inline styles, because plotly adds them."""

REVALIDATE = "no-cache"
"""Cache-Control header of the page: browsers must revalidate it, since its links may change."""

KEEP = "public, max-age=31536000, immutable"
"""Cache-Control header of the files: they never change, since their paths contain the edition."""


def files() -> str:
    """Return the URL path below which the files of the running edition are served."""
    return f"/static/{edition()}/"


@cache
def index() -> Asset:
    """Return ``index.html`` with links to the files of the running edition."""
    page = pages()["index.html"]
    return Asset(page.body.replace(b"/static/", files().encode()), page.media_type)


def dashboard_router() -> APIRouter:
    """Return a router for ``/``, ``/static/EDITION/…`` and ``/static/EDITION/plotly.min.js``."""
    router = APIRouter(include_in_schema=False, dependencies=[OPEN])
    router.add_api_route("/", _index)
    router.add_api_route(f"{files()}plotly.min.js", _plotly)
    router.add_api_route("/static/{path:path}", _file)
    return router


# The page has about 130 files. They are sent from memory by the event loop: in threads, twelve
# browsers that open the page together would reach the limit on concurrent requests.


async def _index(request: Request) -> Response:
    return _sent(index(), request, REVALIDATE)


def _plotly(request: Request) -> Response:
    """Return the chart library. FastAPI runs this in a thread: the first call compresses 5 MB."""
    return _sent(plotly(), request, KEEP)


async def _file(path: str, request: Request) -> Response:
    made, _, name = path.partition("/")
    asset = pages().get(name)
    if asset is None or made != edition():
        raise HTTPException(404, f"the dashboard has no file {path}")
    return _sent(asset, request, KEEP)


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
