"""Every answer says whether it is about now or about a recording."""

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.settings.storage import Origin

HEADER = "Padwatch-Origin"


class OriginHeader:
    """ASGI middleware that adds the header to all responses."""

    def __init__(self, app: ASGIApp, origin: Origin) -> None:
        self._app, self._origin = app, origin

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, and mark what comes back."""

        async def marked(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message)[HEADER] = self._origin.value
            await send(message)

        await self._app(scope, receive, marked)
