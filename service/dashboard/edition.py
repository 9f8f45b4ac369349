"""Every answer says which program gave it, so that an open page knows when it has become old."""

import hashlib
from functools import cache
from importlib.metadata import version

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.dashboard.assets import pages

HEADER = "Padwatch-Edition"


@cache
def edition() -> str:
    """The versions of program and chart library and the files in short: ``0.6.0-1f2e3d4c``."""
    tags = "".join(f"{path} {asset.etag}" for path, asset in sorted(pages().items()))
    tags += version("plotly")
    return f"{version('padwatch')}-{hashlib.sha256(tags.encode()).hexdigest()[:8]}"


class EditionHeader:
    """ASGI middleware that adds the header to all responses."""

    def __init__(self, app: ASGIApp) -> None:
        self._app, self._edition = app, edition()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, and mark what comes back."""

        async def marked(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message)[HEADER] = self._edition
            await send(message)

        await self._app(scope, receive, marked)
