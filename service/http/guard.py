"""Everything that stands before the application, in its order."""

from collections.abc import Iterable

from starlette.types import ASGIApp

from service.http.answers import BoundedAnswers
from service.http.bodies import WholeBodies
from service.http.head import HeadRequests
from service.http.hosts import KnownHosts
from service.http.security_headers import SecurityHeaders
from service.settings.http_limits import HttpLimitSettings


def guarded(answers: BoundedAnswers, limits: HttpLimitSettings, hosts: Iterable[str]) -> ASGIApp:
    """Put the rest of the defence before an application whose answers are bounded.

    Bodies come before the count of requests, so that slow senders use up nobody's place.
    """
    bodies = WholeBodies(answers, limits)
    return HeadRequests(SecurityHeaders(KnownHosts(bodies, hosts)))
