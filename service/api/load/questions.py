"""Which kind of question a request is: what is asked of the past is given up first."""

import re

from service.api.load.strain import Refused

VITAL = re.compile(
    r"/(livez|readyz|metrics)"
    r"|/api/v1/alarms(/[^/]+)?"  # the list, and one of it
    r"|/api/v1/session"
    r"|/(?!api/).*"  # the pages themselves, without which nobody sees an alarm
)
"""Never refused, as nothing is by which somebody does something: acknowledges, logs in."""

VIEWS = re.compile(
    r"/api/v1/overview"
    r"|/api/v1/sources"
    r"|/api/v1/units(/[^/]+(/channels)?)?"
    r"|/api/v1/units/[^/]+/bearings(/[^/]+(/latest|/orbit|/budgets/[^/]+)?)?"
)
"""What is now, and is answered from memory."""

READING = ("GET", "HEAD")


def question(method: str, path: str) -> Refused:
    """From when on a request is refused; `Refused.NOTHING` for one that never is."""
    if method not in READING or (VITAL.fullmatch(path) and path != "/api/v1/alarms/rates"):
        return Refused.NOTHING
    return Refused.VIEWS if VIEWS.fullmatch(path) else Refused.HISTORY
