"""Times in names of folders and in reports."""

from datetime import UTC, datetime

from core.units import NS_PER_S


def compact(time_ns: int) -> str:
    """Time to the millisecond as a part of a file's name; names sort as times do."""
    seconds, ns = divmod(time_ns, NS_PER_S)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y%m%dT%H%M%S}.{ns // 1_000_000:03d}Z"


def day_and_time(time_ns: int) -> str:
    """Time to the second, for people."""
    return f"{datetime.fromtimestamp(time_ns // NS_PER_S, UTC):%Y-%m-%d %H:%M:%S} UTC"
