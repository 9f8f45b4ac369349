"""How far the stored results of a unit reach, to know after a stop what is missing."""

from core.samples.gaps import Gap, Reach
from service.store.database import Connection

SELECT_SERIES = "SELECT id FROM series WHERE unit = ?"
SELECT_NEWEST = """
    SELECT time_ns, epoch, stop_index FROM assessment
    WHERE series = ? ORDER BY time_ns DESC LIMIT 1
"""
SELECT_BEHIND = """
    SELECT epoch, first_index, n_samples, stop_ns, start_ns, is_estimated FROM gap
    WHERE unit = ? AND epoch = ? AND first_index >= ? ORDER BY first_index
"""


def select_reach(reader: Connection, unit: str) -> Reach | None:
    """Up to where results reach, and the gaps behind that; None if there are no measured ones."""
    newest = [
        tuple(row)
        for (series,) in reader.execute(SELECT_SERIES, (unit,)).fetchall()
        if (row := reader.execute(SELECT_NEWEST, (series,)).fetchone()) is not None
    ]
    time_ns, epoch, stop_index = max(newest, default=(0, 0, 0))
    if not stop_index:  # as of a simulated past, which has no samples
        return None
    behind = reader.execute(SELECT_BEHIND, (unit, epoch, stop_index))
    return Reach(epoch, stop_index, time_ns, tuple(gap_of(row) for row in behind))


def gap_of(row: tuple[int, int, int, int, int | None, int]) -> Gap:
    """A gap as it is stored."""
    epoch, first_index, n_samples, stop_ns, start_ns, is_estimated = row
    return Gap(epoch, first_index, n_samples, stop_ns, start_ns, bool(is_estimated))
