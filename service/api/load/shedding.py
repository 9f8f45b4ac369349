"""`Shedding`: ASGI middleware that refuses questions while the service cannot keep up."""

from starlette.types import ASGIApp, Receive, Scope, Send

from service.api.http.refusals import Refusal
from service.api.load.questions import question
from service.api.load.watch import LoadWatch

BEHIND = Refusal(
    503,
    "Too busy",
    "the service is behind with its samples, which come before questions; ask again later",
    retry_after_s=10,
)


class Shedding:
    """Passes on what is not refused now."""

    def __init__(self, app: ASGIApp, load: LoadWatch) -> None:
        self._app, self._load = app, load

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse a request, or pass it on."""
        if scope["type"] == "http" and self._load.refuses(question(scope["method"], scope["path"])):
            await BEHIND.send(scope, send)
            return
        await self._app(scope, receive, send)
