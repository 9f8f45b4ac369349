"""Times as text, in UTC: RFC 3339 for machines, to the second for people."""

from datetime import UTC, datetime, timedelta

from core.units import NS_PER_S

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def rfc3339(time_ns: int) -> str:
    """Format a time to the millisecond, without rounding error in any year."""
    moment = EPOCH + timedelta(microseconds=time_ns // 1_000_000 * 1000)
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def compact(time_ns: int) -> str:
    """Format a time to the millisecond for a file's name; names sort as times do."""
    seconds, ns = divmod(time_ns, NS_PER_S)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y%m%dT%H%M%S}.{ns // 1_000_000:03d}Z"


def day_and_time(time_ns: int) -> str:
    """Format a time to the second, for people."""
    return f"{datetime.fromtimestamp(time_ns // NS_PER_S, UTC):%Y-%m-%d %H:%M:%S} UTC"
