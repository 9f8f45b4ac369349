"""What a proxy on a unix socket says of a request: where it comes from, and whether by https.

Nobody else is believed: on a TCP port anybody can say what he likes.
"""

from ipaddress import ip_address

from starlette.types import ASGIApp, Receive, Scope, Send

FOR, PROTO = b"x-forwarded-for", b"x-forwarded-proto"


class TrustedProxy:
    """ASGI middleware for a server that only a trusted proxy can reach."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on as one that comes from where the proxy says."""
        if scope["type"] == "http":
            scope["client"] = _client(_last(scope, FOR))
            scope["scheme"] = "https" if _last(scope, PROTO).lower() == "https" else "http"
        await self._app(scope, receive, send)


def _last(scope: Scope, name: bytes) -> str:
    """The last of a list in headers: the proxy has added it, what is before may be made up."""
    values = [value for found, value in scope["headers"] if found == name]
    return values[-1].decode("latin-1").rpartition(",")[2].strip() if values else ""


def _client(address: str) -> tuple[str, int] | None:
    try:
        return str(ip_address(address)), 0
    except ValueError:
        return None
