"""Whole bodies of a bounded size, or none: nothing behind this waits for a client."""

from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.http.json_depth import is_deeper_than
from service.api.http.refusals import BODY_TOO_LARGE, NOT_UTF8, TOO_DEEP, Refusal
from service.settings.processes import HttpLimitSettings


class TooLargeError(Exception):
    """A body is larger than allowed."""


class WholeBodies:
    """ASGI middleware that reads a body before the application is asked.

    How long it may take is for the connection to say.
    """

    def __init__(self, app: ASGIApp, limits: HttpLimitSettings) -> None:
        self._app, self._limits = app, limits

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on with its body in one piece."""
        try:
            body = await self._body(scope, receive)
        except TooLargeError:
            await BODY_TOO_LARGE.send(scope, send)
            return
        except ClientDisconnect:
            return
        refusal = self._wrong(body)
        if refusal is not None:
            await refusal.send(scope, send)
            return
        await self._app(scope, _given(body, receive), send)

    async def _body(self, scope: Scope, receive: Receive) -> bytes:
        limit = 1024 * self._limits.max_body_kb
        if any(
            _says_more(value, limit)
            for name, value in scope["headers"]
            if name == b"content-length"
        ):
            raise TooLargeError
        body = bytearray()
        while True:
            message = await receive()
            if message["type"] == "http.disconnect":
                raise ClientDisconnect
            body += message.get("body", b"")
            if len(body) > limit:
                raise TooLargeError
            if not message.get("more_body", False):
                return bytes(body)

    def _wrong(self, body: bytes) -> Refusal | None:
        try:
            body.decode()
        except UnicodeDecodeError:
            return NOT_UTF8
        return TOO_DEEP if is_deeper_than(self._limits.max_json_depth, body) else None


def _says_more(length: bytes, limit: int) -> bool:
    digits = length.strip().lstrip(b"0")
    # int() of very long numbers is slow, and refused from 4300 digits on
    return len(digits) > 18 or int(digits or b"0") > limit


def _given(body: bytes, receive: Receive) -> Receive:
    """The body once, then what the connection says."""
    whole: list[Message] = [{"type": "http.request", "body": body, "more_body": False}]

    async def given() -> Message:
        return whole.pop() if whole else await receive()

    return given
