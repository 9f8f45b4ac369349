"""Facts that a request shows of its sender: credentials, address, and origin of the page."""

from dataclasses import dataclass, field
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.types import Scope

from service.settings.processes import is_loopback
from service.store.access.identities import Identity, Means

COOKIE = "__Host-padwatch"
"""Name of the session cookie over HTTPS; ``__Host-`` restricts it to one host and to HTTPS."""

PLAIN_COOKIE = "padwatch"
"""Name of the session cookie over HTTP, since some browsers reject secure cookies over HTTP."""


def credentials_of(scope: Scope) -> tuple[Means | None, str]:
    """Return the credentials in the headers of a request; a key takes precedence over a cookie.

    The result is the method, None without credentials, and the session token or API key, empty if
    ambiguous, as with two cookies. Authorization headers of other schemes than Bearer are for
    proxies, and are ignored.
    """
    headers = Headers(scope=scope)
    pairs = [value.partition(" ") for value in headers.getlist("authorization")]
    keys = [key.strip() for scheme, _, key in pairs if scheme.lower() == "bearer"]
    if keys:
        return Means.KEY, keys[0] if len(keys) == 1 else ""
    cookies = ";".join(headers.getlist("cookie")).split(";")
    for wanted in (COOKIE, PLAIN_COOKIE) if scope["scheme"] == "http" else (COOKIE,):
        pairs = [cookie.strip().partition("=") for cookie in cookies]
        if tokens := [value for name, _, value in pairs if name.strip() == wanted]:
            return Means.SESSION, tokens[0] if len(tokens) == 1 else ""
    return None, ""


PASSED_ON = (b"forwarded", b"x-forwarded-for", b"x-real-ip", b"via")
"""Names of headers that proxies add; a request with such a header may come from any computer."""


def is_from_here(scope: Scope) -> bool:
    """Whether a request comes directly from this computer, not through a proxy."""
    client = scope.get("client")
    if client is None or not is_loopback(str(client[0])):
        return False
    return not any(name in PASSED_ON for name, _ in scope["headers"])


OWN_SITES = ("same-origin", "none")
"""Accepted values of the header `Sec-Fetch-Site`: own pages, and addresses typed by the user."""


def is_foreign(scope: Scope, *, requires_origin: bool) -> bool:
    """Whether a request may come from a page of another origin (cross-site request forgery).

    Browsers send cookies with requests of pages of any site, and let these pages reach loopback.
    With `requires_origin`, a request without headers ``Origin`` and ``Sec-Fetch-Site`` counts as
    foreign.
    """
    headers = Headers(scope=scope)
    hosts, origins = headers.getlist("host"), headers.getlist("origin")
    sites = headers.getlist("sec-fetch-site")
    if not origins and not sites:
        return requires_origin
    is_own = all(_is_own(origin, scope["scheme"], hosts) for origin in origins)
    return not is_own or any(site not in OWN_SITES for site in sites)


def _is_own(origin: str, scheme: str, hosts: list[str]) -> bool:
    try:
        given = urlsplit(origin)
    except ValueError:
        return False
    # behind a proxy that terminates TLS, the page uses https and the request http
    return given.scheme in (scheme, "https") and [given.netloc] == hosts


CALLER = "caller"
"""Key under which the ``state`` of an ASGI scope contains the caller."""


@dataclass(frozen=True)
class Caller:
    """Sender of a request, authenticated or not.

    Parameters
    ----------
    identity
        Identity of the caller; None without valid credentials if a login is required.
    means, secret
        Credentials in the request, valid or not, as by `credentials_of`.
    must_log_in
        Whether requests from the caller's address require a login or key.
    """

    identity: Identity | None
    means: Means | None
    secret: str = field(repr=False)
    must_log_in: bool
