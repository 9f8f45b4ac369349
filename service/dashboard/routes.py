"""Routes of the dashboard: the page, its files, and the chart library."""

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
"""Scripts from this server only; plotly adds style elements, hence the inline styles."""

REVALIDATE = "no-cache"
"""Cache control of the page, which names the files of the running edition."""

KEEP = "public, max-age=31536000, immutable"
"""Cache control of the files, whose paths contain their edition."""


def files() -> str:
    """Return the path of the files of this edition."""
    return f"/static/{edition()}/"


@cache
def index() -> Asset:
    """Return the page, which names the files of this edition."""
    page = pages()["index.html"]
    return Asset(page.body.replace(b"/static/", files().encode()), page.media_type)


def dashboard_router() -> APIRouter:
    """Build the routes ``/``, ``/static/EDITION/…`` and ``/static/EDITION/plotly.min.js``."""
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
    """Return the chart library, in a thread: the first call compresses five megabytes."""
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
