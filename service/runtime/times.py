"""Text formats of times in UTC: RFC 3339, compact for file names, and readable."""

from datetime import UTC, datetime, timedelta

from core.units import NS_PER_S

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def rfc3339(time_ns: int) -> str:
    """Return a time, ns since 1970 UTC, in RFC 3339 format, truncated to the millisecond."""
    moment = EPOCH + timedelta(microseconds=time_ns // 1_000_000 * 1000)
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def compact(time_ns: int) -> str:
    """Return a time, ns since 1970 UTC, as text such as ``20260131T120000.000Z``.

    The text is truncated to the millisecond; names that begin with it sort by time.
    """
    seconds, ns = divmod(time_ns, NS_PER_S)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y%m%dT%H%M%S}.{ns // 1_000_000:03d}Z"


def day_and_time(time_ns: int) -> str:
    """Return a time, ns since 1970 UTC, as readable text such as ``2026-01-31 12:00:00 UTC``."""
    return f"{datetime.fromtimestamp(time_ns // NS_PER_S, UTC):%Y-%m-%d %H:%M:%S} UTC"


CLOCK_STEP_S = 0.5
"""Clock step, s, above which the clock counts as set; NTP slews smaller errors."""
