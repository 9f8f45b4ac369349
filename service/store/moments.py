"""A moment of its own for each row: a clock that was set back shows a time twice."""

from service.store.database import Connection


def free_moment(
    writer: Connection,
    taken: str,
    key: tuple[object, ...],
    time_ns: int,
    measured: tuple[object, ...],
) -> int:
    """Find the first nanosecond from a time on that has no other row, or has this very one.

    A device without a battery begins at the same second each time it is switched on, and one that
    is set back by an hour goes through the hour again. What was measured the second time is no
    repetition of the first.

    Parameters
    ----------
    taken
        Statement that reads what is there, by key and time.
    measured
        What tells one measurement from another: the columns that it reads.
    """
    while writer.execute(taken, (*key, time_ns)).fetchone() not in (None, measured):
        time_ns += 1
    return time_ns
