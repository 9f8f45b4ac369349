"""What a request shows of who sends it: a session's cookie, a machine's key, or nothing."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from enum import Enum, auto

COOKIE = "__Host-padwatch"
"""Browsers take it from a secure origin alone (loopback counts), for that host and every path."""

PLAIN_COOKIE = "padwatch"
"""Over plain HTTP: not all browsers take a secure cookie from loopback."""

BEARER = "bearer"

Headers = Iterable[tuple[bytes, bytes]]


class Kind(Enum):
    """What was shown."""

    NOTHING = auto()
    SESSION = auto()
    KEY = auto()

    WRONG = auto()
    """Something that cannot be one thing alone, such as two cookies: it is not guessed which."""


@dataclass(frozen=True)
class Credentials:
    """What was shown; a key goes before a cookie."""

    kind: Kind
    secret: str = field(default="", repr=False)


NOTHING, WRONG = Credentials(Kind.NOTHING), Credentials(Kind.WRONG)


def credentials_of(headers: Headers, scheme: str) -> Credentials:
    """Read them out of the headers of a request that came by a scheme."""
    found = list(headers)
    keys = list(_keys(value.decode("latin-1") for name, value in found if name == b"authorization"))
    if len(keys) > 1:
        return WRONG
    if keys:
        return Credentials(Kind.KEY, keys[0])
    values = [value.decode("latin-1") for name, value in found if name == b"cookie"]
    cookies = _cookies(values, COOKIE)
    if not cookies and scheme == "http":
        cookies = _cookies(values, PLAIN_COOKIE)
    if len(cookies) > 1:
        return WRONG
    return Credentials(Kind.SESSION, cookies[0]) if cookies else NOTHING


def _keys(values: Iterable[str]) -> Iterator[str]:
    """Keys in headers; another scheme is for a proxy that has a login of its own."""
    for value in values:
        scheme, _, key = value.partition(" ")
        if scheme.lower() == BEARER:
            yield key.strip()


def _cookies(values: Iterable[str], wanted: str) -> list[str]:
    pairs = (pair.strip().partition("=") for value in values for pair in value.split(";"))
    return [value for name, _, value in pairs if name.strip() == wanted]
