"""Everything that stands before the application, in its order."""

from collections.abc import Iterable

from starlette.types import ASGIApp

from service.api.http.answers import BoundedAnswers
from service.api.http.bodies import WholeBodies
from service.api.http.head import HeadRequests
from service.api.http.hosts import KnownHosts
from service.api.http.security_headers import SecurityHeaders
from service.settings.processes import HttpLimitSettings


def guarded(answers: BoundedAnswers, limits: HttpLimitSettings, hosts: Iterable[str]) -> ASGIApp:
    """Put the rest of the defence before an application whose answers are bounded.

    Bodies come before the count of requests, so that slow senders use up nobody's place.
    """
    bodies = WholeBodies(answers, limits)
    return HeadRequests(SecurityHeaders(KnownHosts(bodies, hosts)))
