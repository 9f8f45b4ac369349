"""Time at the API: RFC 3339 in UTC outside, nanoseconds inside."""

from datetime import UTC, datetime

from core.units import NS_PER_S
from service.api.problems import ProblemError
from service.runtime.times import EPOCH, rfc3339

FIRST, LAST = datetime.min.replace(tzinfo=UTC), datetime.max.replace(tzinfo=UTC)


def written_as_date(text: object) -> object:
    """Refuse a bare number, which could be a year as well as seconds since 1970.

    Raises
    ------
    ValueError
        Saying how a time is written.
    """
    if isinstance(text, str) and "-" not in text[1:]:
        raise ValueError("a time is written like 2026-11-21T08:00:00Z")
    return text


def ns_from_datetime(moment: datetime, parameter: str) -> int:
    """Nanoseconds since 1970; what an offset carries out of the years 1 to 9999 is cut off there.

    Raises
    ------
    ProblemError
        If the time carries no offset: local time would be a guess.
    """
    if moment.tzinfo is None:
        detail = f"{parameter} needs an offset from UTC, such as a trailing Z"
        raise ProblemError(422, "Wrong parameter", detail, parameter)
    elapsed = min(max(moment, FIRST), LAST) - EPOCH
    return (elapsed.days * 86_400 + elapsed.seconds) * NS_PER_S + elapsed.microseconds * 1000


def require_order(start_ns: int, end_ns: int) -> None:
    """Refuse a range of time that holds nothing.

    Raises
    ------
    ProblemError
        If it does not begin before it ends.
    """
    if start_ns >= end_ns:
        detail = f"start {rfc3339(start_ns)} must be before end {rfc3339(end_ns)}"
        raise ProblemError(422, "Wrong parameter", detail, "start")
