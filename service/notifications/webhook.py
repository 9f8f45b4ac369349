"""Messages as POST requests: signed, bounded, and judged by the status of the answer alone."""

import asyncio
import contextlib
import hashlib
import hmac
from dataclasses import dataclass
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from importlib.metadata import version
from urllib.parse import urlsplit

import httpcore2

from acquisition.clock import Clock
from acquisition.delivery.network import NameLookUp
from core.units import NS_PER_S
from service.notifications.bounded import BoundedNetwork
from service.notifications.message import Message
from service.notifications.network import PATIENT, Timeouts, Trust, printable, words
from service.notifications.outcome import Delivered, Failed, Outcome, Refused
from service.notifications.secret import Secret, SecretError

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
