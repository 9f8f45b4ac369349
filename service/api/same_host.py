"""Who may act while there is no login: this host, and no page of another site in its browsers."""

from ipaddress import ip_address
from urllib.parse import urlsplit

from fastapi import Request

from service.api.problems import ProblemError


def require_same_host(request: Request) -> None:
    """Answer 403 to a request that comes from elsewhere.

    Raises
    ------
    ProblemError
        If the client is not on this host, or a browser says that another site's page asks.
    """
    if request.client is None or not _is_loopback(request.client.host):
        raise ProblemError(
            403, "Not from this host", "there is no login yet: act on the host of the service"
        )
    origin = request.headers.get("origin")
    site = request.headers.get("sec-fetch-site", "same-origin")
    if site not in ("same-origin", "none") or not _is_own(origin, request.headers.get("host", "")):
        raise ProblemError(
            403, "Not from this site", "a page of another site asks for it: that is refused"
        )


def _is_loopback(host: str) -> bool:
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return False


def _is_own(origin: str | None, host: str) -> bool:
    return origin is None or urlsplit(origin).netloc == host
