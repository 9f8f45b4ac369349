"""Problem documents (RFC 9457) for requests refused before they reach the application."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from http import HTTPStatus

from starlette.types import Scope, Send

MEDIA_TYPE = b"application/problem+json"

MAX_INSTANCE = 256
"""Maximum length of the request path in an answer, characters."""


@dataclass(frozen=True)
class Refusal:
    """Refusal of a request: fixed text of the problem document.

    Parameters
    ----------
    retry_after_s
        Value of the header Retry-After, s; None omits the header.
    """

    status: int
    title: str
    detail: str
    retry_after_s: int | None = None

    def body(self, instance: str = "") -> bytes:
        """Return the problem document as JSON; `instance` is the path of the request."""
        problem = {
            "type": "about:blank",
            "title": self.title,
            "status": self.status,
            "detail": self.detail,
            "instance": instance[:MAX_INSTANCE],
            "errors": [],
        }
        return json.dumps(problem).encode()

    def headers(self, n_bytes: int) -> list[tuple[bytes, bytes]]:
        """Return the HTTP headers for a problem document of `n_bytes` bytes."""
        headers = [(b"content-type", MEDIA_TYPE), (b"content-length", b"%d" % n_bytes)]
        if self.retry_after_s is not None:
            headers.append((b"retry-after", b"%d" % self.retry_after_s))
        return headers

    def as_http(self, more: Sequence[tuple[str, str]]) -> bytes:
        """Return the complete HTTP/1.1 answer, with further headers and ``Connection: close``."""
        body = self.body()
        line = b"HTTP/1.1 %d %s\r\n" % (self.status, HTTPStatus(self.status).phrase.encode())
        added = [(name.encode(), value.encode()) for name, value in more]
        headers = [*self.headers(len(body)), *added, (b"connection", b"close")]
        return line + b"".join(b"%s: %s\r\n" % header for header in headers) + b"\r\n" + body

    async def send(self, scope: Scope, send: Send) -> None:
        """Send the problem document as the answer to an ASGI request."""
        # JSON escapes characters of the path beyond ASCII
        body = self.body(scope["path"])
        headers = self.headers(len(body))
        await send({"type": "http.response.start", "status": self.status, "headers": headers})
        await send({"type": "http.response.body", "body": body, "more_body": False})


NOT_HTTP = Refusal(400, "Malformed request", "malformed HTTP/1.1 request")
NO_HOST = Refusal(400, "Invalid Host header", "a request must have exactly one Host header")
NOT_UTF8 = Refusal(400, "Invalid UTF-8", "the body is not valid UTF-8")
TOO_DEEP = Refusal(400, "JSON nested too deeply", "the JSON body is nested too deeply")
TOO_SLOW = Refusal(408, "Request timeout", "the request was not received in time")
BODY_TOO_LARGE = Refusal(413, "Body too large", "the body is larger than allowed")
TARGET_TOO_LONG = Refusal(414, "URI too long", "path and query are longer than allowed")
WRONG_HOST = Refusal(421, "Unknown host", "the Host header is not a name of this service")
HEAD_TOO_LARGE = Refusal(431, "Headers too large", "request line and headers are too large")
BUSY = Refusal(503, "Busy", "too many concurrent requests; try again", retry_after_s=1)
FULL = Refusal(503, "Busy", "too many connections; try again", retry_after_s=5)
NO_ANSWER = Refusal(503, "Response timeout", "the request timed out; request a shorter range", 5)
