"""Deleting what is old and stands in wider roll-ups, a bounded number at a time.

Nothing is deleted that has not been computed anew and found in all wider tiers: an hour of which
that is not so is gathered anew while its readings are there, and looked at again.
"""

from enum import Enum
from itertools import pairwise

import numpy as np

from service.store.database import Connection
from service.store.retention.marks import SINGLE_S, select_gone, set_gone
from service.store.rollups.making import forget_width, minutes_of, rolled_columns, select_mark
from service.store.rollups.rows import HOUR_NS, NS_PER_S, WIDTHS_NS, Cells, select_cells
from service.store.trends import Span

MAX_READINGS = 1000
"""Of one piece of work, during which nobody else writes: some tens of milliseconds."""

MAX_HOURS = 6
"""Of roll-ups, likewise."""

MEAN_TOLERANCE = 1e-9
"""Of the extremes: sums depend on the order of what is added."""

NEXT_READINGS = """
    SELECT time_ns FROM assessment WHERE series = ? AND time_ns >= ? AND time_ns < ?
    ORDER BY time_ns LIMIT ?
"""
NEXT_CELL = """
    SELECT start_ns FROM rollup_cell
    WHERE series = ? AND width_s = ? AND start_ns >= ? AND start_ns < ?
    ORDER BY start_ns LIMIT 1
"""
DELETE_READINGS = "DELETE FROM assessment WHERE series = ? AND time_ns >= ? AND time_ns < ?"
REDONE = "SELECT start_ns FROM rollup_redo WHERE series = ? AND start_ns >= ? AND start_ns < ?"
REDO = "INSERT INTO rollup_redo VALUES (?, ?) ON CONFLICT DO NOTHING"


class Piece(Enum):
    """What became of a piece of work: there was none, it was done, or it cannot be done."""

    NONE = "none"
    DONE = "done"
    HELD_UP = "held_up"


def delete_readings(writer: Connection, series: int, before_ns: int) -> Piece:
    """Delete the next old single readings of a bearing."""
    gone = select_gone(writer, series)
    limit_ns = _floor(min(before_ns, select_mark(writer, series)))
    span = _next_readings(writer, series, (gone.readings_ns, limit_ns))
    end_ns = _fit_until(writer, series, span)
    if end_ns <= span[0]:
        return Piece.NONE
    writer.execute(DELETE_READINGS, (series, span[0], end_ns))
    set_gone(writer, series, SINGLE_S, end_ns)
    return Piece.DONE


def delete_rollups(writer: Connection, series: int, width_ns: int, before_ns: int) -> Piece:
    """Delete the next old roll-ups of a width.

    Those that wider ones do not say the same as stay, and hold up what is behind them: what is
    finer is gone, so nothing can be gathered anew, and up to when all is gone is one time.
    """
    width_s, gone = width_ns // NS_PER_S, select_gone(writer, series)
    finer_s = {wider // NS_PER_S: finer // NS_PER_S for finer, wider in pairwise((0, *WIDTHS_NS))}
    limit_ns = _floor(min(before_ns, gone.of(finer_s[width_s])))
    span = _next_cells(writer, series, width_s, (gone.of(width_s), limit_ns))
    if span[0] >= span[1] or writer.execute(REDONE, (series, *span)).fetchone():
        return Piece.NONE  # late readings are merged first
    fine = select_cells(writer, series, width_ns, span, rolled_columns())
    wider_ns = [wider for wider in WIDTHS_NS if wider > width_ns]
    if fine is None or not all(_stands_in(writer, series, fine, w, span) for w in wider_ns):
        return Piece.HELD_UP
    forget_width(writer, series, width_ns, span)
    set_gone(writer, series, width_s, span[1])
    return Piece.DONE


def _next_readings(writer: Connection, series: int, within: Span) -> Span:
    """Whole hours with readings that are next; empty if there are none."""
    rows = writer.execute(NEXT_READINGS, (series, *within, MAX_READINGS)).fetchall()
    if not rows:
        return within[0], within[0]
    first_ns, last_ns = _floor(rows[0][0]), _floor(rows[-1][0])
    is_cut = len(rows) == MAX_READINGS and last_ns > first_ns
    return first_ns, last_ns if is_cut else last_ns + HOUR_NS


def _next_cells(writer: Connection, series: int, width_s: int, within: Span) -> Span:
    row = writer.execute(NEXT_CELL, (series, width_s, *within)).fetchone()
    if row is None:
        return within[0], within[0]
    return _floor(row[0]), min(_floor(row[0]) + MAX_HOURS * HOUR_NS, within[1])


def _fit_until(writer: Connection, series: int, span: Span) -> int:
    """Up to when all hours stand in roll-ups; the first one that does not is to be redone."""
    redone = {row[0] for row in writer.execute(REDONE, (series, *span))}
    for hour_ns in range(span[0], span[1], HOUR_NS):
        if hour_ns in redone:
            return hour_ns
        hour = (hour_ns, hour_ns + HOUR_NS)
        minutes = minutes_of(writer, series, hour)
        if minutes is not None and not all(
            _stands_in(writer, series, minutes, width, hour) for width in WIDTHS_NS
        ):
            writer.execute(REDO, (series, hour_ns))
            return hour_ns
    return span[1]


def _stands_in(writer: Connection, series: int, fine: Cells, width_ns: int, span: Span) -> bool:
    """Whether the roll-ups of a width say what finer ones say."""
    wanted = fine.gathered(width_ns)
    found = select_cells(writer, series, width_ns, span, rolled_columns())
    return found is not None and _is_same(found, wanted)


def _is_same(found: Cells, wanted: Cells) -> bool:
    ours, theirs = found.summaries, wanted.summaries
    if not np.array_equal(ours.time_ns, theirs.time_ns):
        return False
    exact = (
        (found.conditions.n_readings, wanted.conditions.n_readings),
        (found.conditions.state, wanted.conditions.state),
        (ours.count, theirs.count),
        (ours.level, theirs.level),
        (ours.minimum, theirs.minimum),
        (ours.maximum, theirs.maximum),
    )
    if not all(np.array_equal(a, b, equal_nan=a.dtype.kind == "f") for a, b in exact):
        return False
    largest = np.fmax(np.abs(theirs.minimum), np.abs(theirs.maximum))
    with np.errstate(invalid="ignore"):
        is_off = np.abs(ours.mean - theirs.mean) > MEAN_TOLERANCE * largest
    return not bool(is_off.any())


def _floor(time_ns: int) -> int:
    return time_ns - time_ns % HOUR_NS
