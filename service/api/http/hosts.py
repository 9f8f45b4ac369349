"""Only requests that ask for this service by a name it has.

A page of another site can let its own name point to 127.0.0.1 (DNS rebinding) and then reads the
answers as its own; the Host header still carries its name.
"""

import re
from collections.abc import Iterable

from starlette.types import ASGIApp, Receive, Scope, Send

from service.api.http.refusals import NO_HOST, WRONG_HOST

HOST = re.compile(r"(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+)(?::[0-9]{1,5})?")
"""A name or an address, an IPv6 one in brackets, and perhaps a port."""

LOOPBACK = ("localhost", "127.0.0.1", "::1")


class KnownHosts:
    """ASGI middleware that refuses requests for anybody else.

    Parameters
    ----------
    hosts
        Names and addresses, without port, besides those of loopback and the address that a client
        came to: a page of another site has a name.
    """

    def __init__(self, app: ASGIApp, hosts: Iterable[str]) -> None:
        self._app = app
        self._known = {host.lower().strip("[]").rstrip(".") for host in (*LOOPBACK, *hosts)}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on if it is for this service."""
        asked = [value for name, value in scope["headers"] if name == b"host"]
        if len(asked) != 1 or not asked[0]:
            await NO_HOST.send(scope, send)
        elif self._is_known(_name(asked[0].decode("latin-1")), scope):
            await self._app(scope, receive, send)
        else:
            await WRONG_HOST.send(scope, send)

    def _is_known(self, name: str, scope: Scope) -> bool:
        address, _ = scope.get("server") or ("", None)
        return name in self._known or (bool(name) and name == address.removeprefix("::ffff:"))


def _name(host: str) -> str:
    """A Host header without its port; empty if it is malformed."""
    found = HOST.fullmatch(host)
    return found[1].strip("[]").rstrip(".").lower() if found else ""
