"""Messages as signed POST requests; answers are read in small pieces and to a limit."""

import asyncio
import contextlib
import hashlib
import hmac
import ssl
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from importlib.metadata import version
from typing import Any
from urllib.parse import urlsplit

import httpcore2

from acquisition.clock import Clock
from acquisition.delivery.network import NameLookUp
from core.units import NS_PER_S
from service.notifications.channel import (
    PATIENT,
    Delivered,
    Failed,
    Outcome,
    Refused,
    Secret,
    SecretError,
    Timeouts,
    Trust,
    printable,
    words,
)
from service.notifications.message import Message

PIECE_BYTES = 1024
"""Most that is parsed without giving the event loop to others."""

MAX_BYTES = 32_768
"""Most that is read of one answer, headers included."""

SocketOption = (
    tuple[int, int, int] | tuple[int, int, bytes | bytearray] | tuple[int, int, None, int]
)


class BoundedStream(httpcore2.AsyncNetworkStream):
    """A connection of which at most so much is read.

    Parameters
    ----------
    n_left
        Bytes that may still be read.
    """

    def __init__(self, stream: httpcore2.AsyncNetworkStream, n_left: int = MAX_BYTES) -> None:
        self._stream, self._n_left = stream, n_left

    async def read(self, max_bytes: int, timeout: float | None = None) -> bytes:
        """Read a piece.

        Raises
        ------
        httpcore2.ReadError
            If there was too much already.
        """
        if self._n_left <= 0:
            raise httpcore2.ReadError(f"the answer is longer than {MAX_BYTES} bytes")
        found = await self._stream.read(min(max_bytes, PIECE_BYTES), timeout)
        self._n_left -= len(found)
        await asyncio.sleep(0)  # what has been received already is handed out without waiting
        return found

    async def write(self, buffer: bytes, timeout: float | None = None) -> None:
        """Send."""
        await self._stream.write(buffer, timeout)

    async def aclose(self) -> None:
        """Close."""
        await self._stream.aclose()

    async def start_tls(
        self,
        ssl_context: ssl.SSLContext,
        server_hostname: str | None = None,
        timeout: float | None = None,
    ) -> httpcore2.AsyncNetworkStream:
        """Encrypt."""
        encrypted = await self._stream.start_tls(ssl_context, server_hostname, timeout)
        return BoundedStream(encrypted, self._n_left)

    def get_extra_info(self, info: str) -> Any:
        """What the connection beneath knows of itself."""
        return self._stream.get_extra_info(info)


class BoundedNetwork(httpcore2.AsyncNetworkBackend):
    """Connects to a name by its own look-up."""

    def __init__(self, look_up: NameLookUp) -> None:
        self._look_up, self._network = look_up, httpcore2.AnyIOBackend()

    async def connect_tcp(
        self,
        host: str,
        port: int,
        timeout: float | None = None,
        local_address: str | None = None,
        socket_options: Iterable[SocketOption] | None = None,
    ) -> httpcore2.AsyncNetworkStream:
        """Connect to the first address that answers.

        Raises
        ------
        OSError
            If the name has no address.
        httpcore2.ConnectError, httpcore2.ConnectTimeout
            If none of its addresses answers.
        """
        failure: Exception = httpcore2.ConnectError(f"{host} has no address")
        async with asyncio.timeout(timeout):
            addresses = await self._look_up.addresses()
        for address in addresses:
            try:
                stream = await self._network.connect_tcp(
                    address, port, timeout, local_address, socket_options
                )
            except (httpcore2.ConnectError, httpcore2.ConnectTimeout) as error:
                failure = error
            else:
                return BoundedStream(stream)
        raise failure


EXCERPT_BYTES = 1024
EXCERPT_S = 2.0
"""How much of a refusal is read, to be shown, and for how long; of a consent nothing is."""

FAULTS = (httpcore2.NetworkError, httpcore2.ProtocolError, httpcore2.UnsupportedProtocol)
"""What the library calls what goes wrong on the network, time-outs apart."""

TRY_AGAIN = (408, 425, 429)
"""Answers of 4xx that do not say that the message is wrong."""


@dataclass(frozen=True)
class WebhookTarget:
    """Where messages go.

    Parameters
    ----------
    secret
        Signs them, if there is one.
    authorization
        Value of the Authorization header, if there is one.
    """

    url: str
    secret: Secret | None = None
    authorization: Secret | None = None
    timeouts: Timeouts = PATIENT


class Webhook:
    """Carries messages to a web server; a connection for each."""

    def __init__(self, target: WebhookTarget, trust: Trust, clock: Clock) -> None:
        self._target, self._trust, self._clock = target, trust, clock
        url = urlsplit(target.url)
        port = url.port or (443 if url.scheme == "https" else 80)
        self._look_up = NameLookUp(url.hostname or "", port)

    async def carry(self, message: Message, body: str) -> Outcome:
        """Try once."""
        try:
            async with asyncio.timeout(self._target.timeouts.total_s):
                return await self._post(message["id"], body.encode())
        except httpcore2.TimeoutException:
            return Failed(words(TimeoutError()))
        except (*FAULTS, OSError, ValueError, SecretError) as error:
            return Failed(printable(words(error)))

    async def _post(self, id_: str, body: bytes) -> Outcome:
        headers, timeouts = self._headers(id_, body), self._target.timeouts
        limits = dict.fromkeys(("read", "write", "pool"), timeouts.answer_s)
        # a bare pool: no redirects, cookies, proxies or netrc, whatever an answer says
        async with (
            httpcore2.AsyncConnectionPool(
                ssl_context=await self._trust.context(),
                network_backend=BoundedNetwork(self._look_up),
            ) as pool,
            pool.stream(
                "POST",
                self._target.url,
                headers=list(headers.items()),
                content=body,
                extensions={"timeout": {**limits, "connect": timeouts.connect_s}},
            ) as response,
        ):
            return await self._judged(response)

    async def _judged(self, response: httpcore2.Response) -> Outcome:
        status = response.status
        said = {name.lower(): text.decode("latin-1") for name, text in response.headers}
        if 200 <= status < 300:
            return Delivered(f"{status}")
        if 300 <= status < 400:
            where = said.get(b"location", "elsewhere")
            return Failed(printable(f"{status}: sends on to {where}, which is not followed"))
        answer = printable(f"{status} {await _excerpt(response)}")
        if 400 <= status < 500 and status not in TRY_AGAIN:
            return Refused(answer)
        return Failed(answer, retry_after_s(said.get(b"retry-after"), self._clock))

    def _headers(self, id_: str, body: bytes) -> dict[str, str]:
        """What goes with a message.

        Raises
        ------
        SecretError
            If a secret is not to be had: nothing is sent without what should prove it.
        """
        time_s = str(self._clock.now_ns() // NS_PER_S)
        headers = {
            "Host": urlsplit(self._target.url).netloc,
            "Content-Type": "application/json",
            "Accept-Encoding": "identity",
            "Connection": "close",
            "User-Agent": f"padwatch/{version('padwatch')}",
            "Padwatch-Event-Id": id_,
            "Idempotency-Key": f'"{id_}"',
            "Padwatch-Timestamp": time_s,
        }
        if self._target.secret is not None:
            headers["Padwatch-Signature"] = signature(self._target.secret.read(), time_s, body)
        if self._target.authorization is not None:
            headers["Authorization"] = self._target.authorization.read()
        return headers


def signature(secret: str, time_s: str, body: bytes) -> str:
    """HMAC-SHA-256 over time stamp, a dot and body, so that an old message cannot be sent anew."""
    signed = time_s.encode() + b"." + body
    return "v1=" + hmac.new(secret.encode(), signed, hashlib.sha256).hexdigest()


def retry_after_s(text: str | None, clock: Clock) -> float | None:
    """When a server wants to be asked again (RFC 9110, 10.2.3): seconds or a date; else None."""
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
    """Read the beginning of what it says; an answer that never ends, or breaks off, will do."""
    found = b""
    with contextlib.suppress(*FAULTS, httpcore2.TimeoutException, TimeoutError):
        async with asyncio.timeout(EXCERPT_S):
            async for part in response.aiter_stream():
                found += part[:EXCERPT_BYTES]
                if len(found) >= EXCERPT_BYTES:
                    break
    return found[:EXCERPT_BYTES].decode("utf-8", "replace")
