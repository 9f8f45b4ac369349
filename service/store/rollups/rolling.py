"""Gathering readings into roll-ups, a bounded number at a time, within one transaction."""

from itertools import pairwise

from service.store.database import Connection
from service.store.retention.marks import select_gone
from service.store.retention.merging import merge_late
from service.store.rollups.making import (
    MINUTE_NS,
    forget_width,
    insert_cells,
    minutes_of,
    rolled_columns,
    select_mark,
)
from service.store.rollups.rows import HOUR_NS, WIDTHS_NS, select_cells
from service.store.trends import Span

MAX_READINGS = 2000
"""Of one piece of work, during which nobody else writes: some tens of milliseconds."""

MAX_REDONE = 24
"""Hours of one piece of work."""

NEXT_TIMES = """
    SELECT time_ns FROM assessment WHERE series = ? AND time_ns >= ? AND time_ns < ?
    ORDER BY time_ns LIMIT ?
"""
SET_MARK = """
    INSERT INTO rollup_mark VALUES (?, ?)
    ON CONFLICT (series) DO UPDATE SET until_ns = excluded.until_ns
"""


def gather_next(writer: Connection, series: int, now_ns: int) -> None:
    """Gather what has come since the mark, as far as its minutes are over, and set the mark."""
    mark_ns = select_mark(writer, series)
    until_ns = _until(writer, series, mark_ns, now_ns)
    if until_ns > mark_ns:
        _gather(writer, series, (mark_ns, until_ns))
        writer.execute(SET_MARK, (series, until_ns))


def gather_anew(writer: Connection, series: int) -> None:
    """Gather the hours again that have got readings since they were gathered."""
    mark_ns = select_mark(writer, series)
    hours = writer.execute(
        "SELECT start_ns FROM rollup_redo WHERE series = ? ORDER BY start_ns LIMIT ?",
        (series, MAX_REDONE),
    ).fetchall()
    gone = select_gone(writer, series)
    for (hour_ns,) in hours:
        if hour_ns < gone.readings_ns:
            merge_late(writer, series, hour_ns, gone)
        else:
            _gather_hour(writer, series, (hour_ns, min(hour_ns + HOUR_NS, mark_ns)))
        writer.execute(
            "DELETE FROM rollup_redo WHERE series = ? AND start_ns = ?", (series, hour_ns)
        )


def _gather_hour(writer: Connection, series: int, span: Span) -> None:
    for width_ns in WIDTHS_NS:
        forget_width(writer, series, width_ns, span)
    _gather(writer, series, span)


def _until(writer: Connection, series: int, mark_ns: int, now_ns: int) -> int:
    """Up to when to gather now: whole minutes, after which there is a reading already."""
    end_ns = now_ns + 1
    times = writer.execute(NEXT_TIMES, (series, mark_ns, end_ns, MAX_READINGS)).fetchall()
    if not times:
        return mark_ns
    first_ns, last_ns = (_floor(time[0], MINUTE_NS) for time in (times[0], times[-1]))
    is_one_minute = len(times) == MAX_READINGS and last_ns == first_ns
    return first_ns + MINUTE_NS if is_one_minute else max(mark_ns, last_ns)


def _gather(writer: Connection, series: int, span: Span) -> None:
    """Fill the spans of every width that end within a span of time."""
    minutes = minutes_of(writer, series, span)
    if minutes is not None:
        insert_cells(writer, series, MINUTE_NS, minutes)
    for finer_ns, width_ns in pairwise(WIDTHS_NS):
        whole = (_floor(span[0], width_ns), _floor(span[1], width_ns))
        cells = select_cells(writer, series, finer_ns, whole, rolled_columns())
        if cells is not None:
            insert_cells(writer, series, width_ns, cells.gathered(width_ns))


def _floor(time_ns: int, width_ns: int) -> int:
    return time_ns - time_ns % width_ns
