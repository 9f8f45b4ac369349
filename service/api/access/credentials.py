"""What a request shows of who sends it: a session's cookie, a machine's key, or nothing."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import Enum, auto

COOKIE = "__Host-padwatch"
"""Browsers take it from a secure origin alone (loopback counts), for that host and every path."""

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


def credentials_of(headers: Headers) -> Credentials:
    """Read them out of the headers of a request."""
    found = list(headers)
    authorizations = [value for name, value in found if name == b"authorization"]
    if len(authorizations) > 1:
        return WRONG
    if authorizations:
        return _authorized(authorizations[0].decode("latin-1"))
    cookies = _cookies(value.decode("latin-1") for name, value in found if name == b"cookie")
    if len(cookies) > 1:
        return WRONG
    return Credentials(Kind.SESSION, cookies[0]) if cookies else NOTHING


def _authorized(value: str) -> Credentials:
    scheme, _, key = value.partition(" ")
    # of another scheme is for somebody else, such as a proxy before this one
    return Credentials(Kind.KEY, key.strip()) if scheme.lower() == BEARER else NOTHING


def _cookies(values: Iterable[str]) -> list[str]:
    pairs = (pair.strip().partition("=") for value in values for pair in value.split(";"))
    return [value for name, _, value in pairs if name.strip() == COOKIE]
