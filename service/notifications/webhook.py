"""Notification channel by webhook: signed POST requests, with limited size of the response."""

import asyncio
import contextlib
import hashlib
import hmac
import ssl
from collections.abc import Iterable
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from importlib.metadata import version
from typing import Any
from urllib.parse import urlsplit

import httpcore2

from acquisition.clock import Clock
from acquisition.delivery.network import HostAddresses
from core.units import NS_PER_S
from service.notifications.channel import (
    Delivered,
    Failed,
    Outcome,
    Refused,
    SecretError,
    TrustedAuthorities,
    error_text,
    printable,
    read_secret,
)
from service.notifications.message import Message
from service.settings.notifications import WebhookSettings

PIECE_BYTES = 1024
"""Maximum number of bytes per read from the network; other tasks run after each read."""

MAX_BYTES = 32_768
"""Maximum size of a response, including its headers."""

SocketOption = (
    tuple[int, int, int] | tuple[int, int, bytes | bytearray] | tuple[int, int, None, int]
)


class _BoundedStream(httpcore2.AsyncNetworkStream):
    """Network stream with a limit on the total number of bytes that are read."""

    def __init__(self, stream: httpcore2.AsyncNetworkStream, n_left: int = MAX_BYTES) -> None:
        self._stream, self._n_left = stream, n_left

    async def read(self, max_bytes: int, timeout: float | None = None) -> bytes:
        """Read and return up to `max_bytes` bytes within `timeout`, in s; None for no limit.

        Raises `httpcore2.ReadError` if the total limit is reached.
        """
        if self._n_left <= 0:
            raise httpcore2.ReadError(f"the response is longer than {MAX_BYTES} bytes")
        found = await self._stream.read(min(max_bytes, PIECE_BYTES), timeout)
        self._n_left -= len(found)
        await asyncio.sleep(0)  # a read of received bytes does not yield to other tasks
        return found

    async def write(self, buffer: bytes, timeout: float | None = None) -> None:
        """Write bytes to the connection within `timeout`, in s; None for no limit."""
        await self._stream.write(buffer, timeout)

    async def aclose(self) -> None:
        """Close the connection."""
        await self._stream.aclose()

    async def start_tls(
        self,
        ssl_context: ssl.SSLContext,
        server_hostname: str | None = None,
        timeout: float | None = None,
    ) -> httpcore2.AsyncNetworkStream:
        """Encrypt the connection with TLS; return the new stream, with the remaining byte limit."""
        encrypted = await self._stream.start_tls(ssl_context, server_hostname, timeout)
        return _BoundedStream(encrypted, self._n_left)

    def get_extra_info(self, info: str) -> Any:
        """Return the item `info` of the metadata of the underlying connection."""
        return self._stream.get_extra_info(info)


class _BoundedNetwork(httpcore2.AsyncNetworkBackend):
    """Network backend that connects to the `HostAddresses` of one host, in bounded streams."""

    def __init__(self, look_up: HostAddresses) -> None:
        self._look_up, self._network = look_up, httpcore2.AnyIOBackend()

    async def connect_tcp(
        self,
        host: str,
        port: int,
        timeout: float | None = None,
        local_address: str | None = None,
        socket_options: Iterable[SocketOption] | None = None,
    ) -> httpcore2.AsyncNetworkStream:
        """Return a connection to the first address of the host that accepts a connection.

        Raises `OSError` if the name cannot be resolved. Raises `httpcore2.ConnectError` or
        `httpcore2.ConnectTimeout` if no address accepts a connection.
        """
        failure: Exception = httpcore2.ConnectError(f"{host} has no address")
        for address in await self._look_up.within(timeout):
            try:
                stream = await self._network.connect_tcp(
                    address, port, timeout, local_address, socket_options
                )
            except (httpcore2.ConnectError, httpcore2.ConnectTimeout) as error:
                failure = error
            else:
                return _BoundedStream(stream)
        raise failure


EXCERPT_BYTES = 1024
EXCERPT_S = 2.0
"""Maximum size and read time of the excerpt of an error response."""

FAULTS = (httpcore2.NetworkError, httpcore2.ProtocolError, httpcore2.UnsupportedProtocol)
"""Exceptions of `httpcore2` for network errors other than time-outs."""

RETRY_STATUSES = (408, 425, 429)
"""HTTP status codes of class 4xx after which the delivery attempt is repeated."""


class Webhook:
    """Notification channel that posts each message to a web server over a new connection."""

    def __init__(self, settings: WebhookSettings, clock: Clock) -> None:
        self._settings, self._trusted = settings, TrustedAuthorities(settings.ca_file)
        self._clock = clock
        url = urlsplit(settings.url)
        self.address = f"{url.scheme}://{url.netloc}"
        """Scheme and host of the URL; its path may contain a token."""
        port = url.port or (443 if url.scheme == "https" else 80)
        self._look_up = HostAddresses(url.hostname or "", port)

    async def send(self, message: Message, body: str) -> Outcome:
        """Make one delivery attempt with a POST request; return its outcome or failure."""
        try:
            async with asyncio.timeout(self._settings.total_timeout_s):
                return await self._post(message["id"], body.encode())
        except httpcore2.TimeoutException:
            return Failed(error_text(TimeoutError()))
        except (*FAULTS, OSError, ValueError, SecretError) as error:
            return Failed(printable(error_text(error)))

    async def _post(self, id_: str, body: bytes) -> Outcome:
        headers, settings = self._headers(id_, body), self._settings
        limits = dict.fromkeys(("read", "write", "pool"), settings.answer_timeout_s)
        # the connection pool ignores redirects, cookies, proxies and netrc files
        async with (
            httpcore2.AsyncConnectionPool(
                ssl_context=await self._trusted.context(),
                network_backend=_BoundedNetwork(self._look_up),
            ) as pool,
            pool.stream(
                "POST",
                settings.url,
                headers=list(headers.items()),
                content=body,
                extensions={"timeout": {**limits, "connect": settings.connect_timeout_s}},
            ) as response,
        ):
            return await self._outcome(response)

    async def _outcome(self, response: httpcore2.Response) -> Outcome:
        status = response.status
        headers = {name.lower(): text.decode("latin-1") for name, text in response.headers}
        if 200 <= status < 300:
            return Delivered(f"{status}")
        if 300 <= status < 400:
            where = headers.get(b"location", "an unknown address")
            return Failed(printable(f"{status}: redirect to {where} is not followed"))
        answer = printable(f"{status} {await _excerpt(response)}")
        if 400 <= status < 500 and status not in RETRY_STATUSES:
            return Refused(answer)
        return Failed(answer, retry_after_s(headers.get(b"retry-after"), self._clock))

    def _headers(self, id_: str, body: bytes) -> dict[str, str]:
        time_s = str(self._clock.now_ns() // NS_PER_S)
        headers = {
            "Host": urlsplit(self._settings.url).netloc,
            "Content-Type": "application/json",
            "Accept-Encoding": "identity",
            "Connection": "close",
            "User-Agent": f"padwatch/{version('padwatch')}",
            "Padwatch-Event-Id": id_,
            "Idempotency-Key": f'"{id_}"',
            "Padwatch-Timestamp": time_s,
        }
        if (secret := self._settings.secret) is not None:
            headers["Padwatch-Signature"] = signature(read_secret(secret), time_s, body)
        if (authorization := self._settings.authorization) is not None:
            headers["Authorization"] = read_secret(authorization)
        return headers


def signature(secret: str, time_s: str, body: bytes) -> str:
    """Return the signature of a request: ``v1=`` and the HMAC-SHA-256 of time stamp, dot and body.

    The time stamp prevents replay.
    """
    signed = time_s.encode() + b"." + body
    return "v1=" + hmac.new(secret.encode(), signed, hashlib.sha256).hexdigest()


def retry_after_s(text: str | None, clock: Clock) -> float | None:
    """Return the delay, in s, that the text of a Retry-After header requests.

    The text is a number of seconds or a date, which is compared with `clock`. Return None if the
    header is missing or invalid (RFC 9110, 10.2.3).
    """
    if text is None:
        return None
    if text.isascii() and text.isdigit():
        return float(text[:9])
    try:
        moment = parsedate_to_datetime(text)
    except ValueError:
        return None
    aware = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    now = datetime.fromtimestamp(clock.now_ns() / NS_PER_S, UTC)
    return max(0.0, (aware - now).total_seconds())


async def _excerpt(response: httpcore2.Response) -> str:
    """Return the first `EXCERPT_BYTES` of a response as text; less if it is slow or incomplete."""
    found = b""
    with contextlib.suppress(*FAULTS, httpcore2.TimeoutException, TimeoutError):
        async with asyncio.timeout(EXCERPT_S):
            async for part in response.aiter_stream():
                found += part[:EXCERPT_BYTES]
                if len(found) >= EXCERPT_BYTES:
                    break
    return found[:EXCERPT_BYTES].decode("utf-8", "replace")
