"""Every answer says which edition of the program gave it."""

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

HEADER = "Padwatch-Edition"


class EditionHeader:
    """ASGI middleware that adds the header to all responses."""

    def __init__(self, app: ASGIApp, edition: str) -> None:
        self._app, self._edition = app, edition

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, and mark what comes back."""

        async def marked(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message)[HEADER] = self._edition
            await send(message)

        await self._app(scope, receive, marked)
