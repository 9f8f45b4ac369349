"""Static files of the dashboard and of the API reference, served from memory.

The path of a file contains a hash, so that browsers can cache it permanently: modules, styles and
pictures are below the edition, a hash of all of them; a library is below the hash of its content.
"""

import gzip
import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.metadata import version
from importlib.resources import files
from importlib.resources.abc import Traversable

from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import ASGIApp, Receive, Scope, Send

from service.api.problems import ProblemError, problem_answer
from service.dashboard.bundle import script_bundle
from service.settings.alarm_kinds import ALARM_KINDS

MEDIA_TYPES = {
    "html": "text/html; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml",
}
"""Media types of served files by suffix; other files are not served."""


@dataclass
class Asset:
    """Static file: content, media type, and gzip content, which is None before `compress`."""

    body: bytes
    media_type: str
    gzipped: bytes | None = None

    @cached_property
    def digest(self) -> str:
        """Hash of the content: the first 32 hexadecimal digits of its SHA-256."""
        return hashlib.sha256(self.body).hexdigest()[:32]

    def compress(self) -> None:
        """Set `gzipped` to the content compressed by gzip, unless it is set."""
        if self.gzipped is None:
            self.gzipped = gzip.compress(self.body, mtime=0)


LIBRARIES = {
    "plotly.min.js": ("plotly", "package_data"),
    "swagger-ui-bundle.js": ("fastapi_offline", "static"),
    "swagger-ui.css": ("fastapi_offline", "static"),
    "recover.js": ("service.dashboard", "library"),
}
"""Package and folder of each file that changes less often than the dashboard."""


@cache
def libraries() -> Mapping[str, tuple[str, Asset]]:
    """Return the URL path and content of each JavaScript or style library, by file name."""
    found = {}
    for name, (package, folder) in LIBRARIES.items():
        asset = _read(files(package) / folder / name)
        found[name] = f"/static/{asset.digest[:12]}/{name}", asset
    return found


STYLES = (
    *("base", "overview", "bearing", "estimates", "alarms", "film", "door", "explorer", "listing"),
    *("unit", "motion"),
)
"""Style sheets in the order in which the page applies them."""


@cache
def pages() -> dict[str, Asset]:
    """Read the files of the dashboard, generate modules of tables, and bundle what the page loads.

    Returns
    -------
    dict of str to Asset
        Files by path below ``static/``, for example ``charts/trend.js``.
    """
    kinds = {
        name: {key: getattr(kind, key) for key in ("label", "subject", "rule", "advice")}
        for name, kind in ALARM_KINDS.items()
    }
    paths = {name: path for name, (path, _) in libraries().items()}
    found = dict(_below(files("service.dashboard") / "static", "")) | {
        "alarm_kinds.js": _module("ALARM_KINDS", kinds),
        "libraries.js": _module("LIBRARIES", paths),
    }
    modules = {path: asset.body.decode() for path, asset in found.items() if path.endswith(".js")}
    script = script_bundle("app.js", modules).encode()
    style = b"".join(found[f"{name}.css"].body for name in STYLES)
    return found | {
        "all.js": Asset(script, MEDIA_TYPES["js"]),
        "all.css": Asset(style, MEDIA_TYPES["css"]),
    }


def _module(name: str, table: Mapping[str, object]) -> Asset:
    """Return a JavaScript module that exports a table."""
    text = f"export const {name} = {json.dumps(table, ensure_ascii=False, indent=2)};\n"
    return Asset(text.encode(), MEDIA_TYPES["js"])


def _read(file: Traversable) -> Asset:
    return Asset(file.read_bytes(), MEDIA_TYPES[file.name.rpartition(".")[2]])


def _below(folder: Traversable, prefix: str) -> list[tuple[str, Asset]]:
    found: list[tuple[str, Asset]] = []
    for entry in folder.iterdir():
        if entry.is_dir():
            found += _below(entry, f"{prefix}{entry.name}/")
        elif entry.name.rpartition(".")[2] in MEDIA_TYPES:
            found.append((prefix + entry.name, _read(entry)))
    return found


@cache
def edition() -> str:
    """Return the edition of the dashboard: program version and hash, such as ``0.6.0-1f2e3d4c``.

    An open page detects an upgrade by comparing its edition with the edition in later answers.
    """
    digests = "".join(f"{path} {asset.digest}" for path, asset in sorted(pages().items()))
    return f"{version('padwatch')}-{hashlib.sha256(digests.encode()).hexdigest()[:8]}"


LINK = re.compile(rb'"/static/([^"]+)"')


def _page(name: str) -> Asset:
    """Return a page with links to the files of the running edition."""
    page = pages()[name]
    return Asset(LINK.sub(_hashed, page.body), page.media_type)


def _hashed(link: re.Match[bytes]) -> bytes:
    name = link[1].decode()
    path = libraries()[name][0] if name in libraries() else f"/static/{edition()}/{name}"
    return f'"{path}"'.encode()


PAGES = {"/": "index.html", "/docs": "docs.html"}
"""File of each page by URL path."""


@cache
def served() -> Mapping[str, Asset]:
    """Return all pages and files of the dashboard by URL path."""
    return (
        {url: _page(name) for url, name in PAGES.items()}
        | {f"/static/{edition()}/{path}": asset for path, asset in pages().items()}
        | dict(libraries().values())
    )


def compress_all() -> None:
    """Compress all static files, which takes about 0.4 s; until then they are sent uncompressed."""
    for asset in served().values():
        asset.compress()


POLICY = (
    "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:;"
    " object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
"""Content security policy of the pages: scripts from this server only; inline styles, because
plotly and Swagger UI add them."""

REVALIDATE = "no-cache"
"""Cache-Control header of the pages: browsers must revalidate them, since their links change."""

KEEP = "public, max-age=31536000, immutable"
"""Cache-Control header of the files: they never change, since their paths contain a hash."""


class StaticFiles:
    """ASGI middleware that answers requests for static files; other requests are forwarded."""

    def __init__(self, app: ASGIApp) -> None:
        self._app, self._served = app, served()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a GET request for a static file, an unknown one with 404; forward others."""
        path = scope["path"] if scope["type"] == "http" and scope["method"] == "GET" else ""
        app = self._app
        if path in self._served:
            caching = REVALIDATE if path in PAGES else KEEP
            app = _answer(self._served[path], caching, Headers(scope=scope))
        elif path.startswith("/static/"):
            detail = "this version of the dashboard has no such file; reload the page"
            app = problem_answer(Request(scope), ProblemError(404, "No such file", detail))
        await app(scope, receive, send)


def _answer(asset: Asset, caching: str, asked: Headers) -> Response:
    packed = asset.gzipped if "gzip" in asked.get("accept-encoding", "") else None
    etag = f'"{asset.digest}"' if packed is None else f'"gz-{asset.digest}"'
    headers = {
        "Content-Security-Policy": POLICY,
        "Cache-Control": caching,
        "ETag": etag,
        "Vary": "Accept-Encoding",
    }
    if etag in asked.get("if-none-match", ""):
        return Response(status_code=304, headers=headers)
    if packed is not None:
        headers["Content-Encoding"] = "gzip"
    body = asset.body if packed is None else packed
    return Response(body, headers=headers, media_type=asset.media_type)
