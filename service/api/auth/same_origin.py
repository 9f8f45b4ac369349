"""Whether a browser sends a request for one of our own pages, or for somebody else's.

Browsers add cookies, and reach loopback, for pages of any site: what changes something must come
from the dashboard itself (cross-site request forgery). Programs with a key are no browsers.
"""

from collections.abc import Iterable
from urllib.parse import urlsplit

SAFE = ("GET", "HEAD", "OPTIONS")
"""Methods that change nothing."""

OWN_SITES = (b"same-origin", b"none")
"""What `Sec-Fetch-Site` says of a page of ours, and of what a person typed himself."""


def is_foreign(scheme: str, headers: Iterable[tuple[bytes, bytes]], must_say: bool) -> bool:
    """Whether a request is, or may be, sent for a page of another origin.

    Parameters
    ----------
    scheme
        By which the request came.
    must_say
        Whether one that says nothing of its origin is foreign, too: programs say nothing, browsers
        do.
    """
    found = list(headers)
    hosts = _all(found, b"host")
    origins, sites = _all(found, b"origin"), _all(found, b"sec-fetch-site")
    if not origins and not sites:
        return must_say
    if any(site not in OWN_SITES for site in sites):
        return True
    return any(not _is_own(origin, scheme, hosts) for origin in origins)


def _all(headers: list[tuple[bytes, bytes]], wanted: bytes) -> list[bytes]:
    return [value for name, value in headers if name == wanted]


def _is_own(origin: bytes, scheme: str, hosts: list[bytes]) -> bool:
    try:
        given = urlsplit(origin.decode("ascii"))
    except ValueError:
        return False
    # behind something that ends TLS a page is of https where the request is not
    is_scheme = given.scheme in (scheme, "https")
    return is_scheme and len(hosts) == 1 and given.netloc.encode() == hosts[0]
