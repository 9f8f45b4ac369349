"""Gathering readings into roll-ups, a bounded number at a time, within one transaction."""

from itertools import pairwise

import numpy as np

from core.quantities import CATALOGUE
from service.store.codec import Layout, columns_of, remember_layout
from service.store.database import Connection
from service.store.rollups.cells import NO_STATE, Cells, Conditions
from service.store.rollups.codec import encoded, parts_of
from service.store.rollups.rows import select_cells
from service.store.rollups.widths import HOUR_NS, NS_PER_S, WIDTHS_NS
from service.store.trends import Span, decoded_rows, select_layouts

MINUTE_NS = WIDTHS_NS[0]

MAX_READINGS = 2000
"""Of one piece of work, during which nobody else writes: some tens of milliseconds."""

MAX_REDONE = 24
"""Hours of one piece of work."""

NEXT_TIMES = """
    SELECT time_ns FROM assessment WHERE series = ? AND time_ns >= ? AND time_ns < ?
    ORDER BY time_ns LIMIT ?
"""
SELECT_WHOLE = """
    SELECT time_ns, layout, reading_values, reading_qualities,
    operating_state, eccentricity_ratio, oil_temperature_c
    FROM assessment WHERE series = ? AND time_ns >= ? AND time_ns < ? ORDER BY time_ns
"""
INSERT_CELL = "INSERT INTO rollup_cell VALUES (?,?,?,?,?,?,?,?,?,?)"
INSERT_NUMBERS = "INSERT INTO rollup_numbers VALUES (?,?,?,?,?,?)"
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
    for (hour_ns,) in hours:
        span = (hour_ns, min(hour_ns + HOUR_NS, mark_ns))
        _forget(writer, series, span)
        _gather(writer, series, span)
        writer.execute(
            "DELETE FROM rollup_redo WHERE series = ? AND start_ns = ?", (series, hour_ns)
        )


def select_mark(reader: Connection, series: int) -> int:
    """Up to when the readings of a bearing have been gathered; 0 if none have."""
    found = reader.execute(
        "SELECT until_ns FROM rollup_mark WHERE series = ?", (series,)
    ).fetchone()
    return 0 if found is None else int(found[0])


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
    minutes = _minutes(writer, series, span)
    if minutes is not None:
        insert_cells(writer, series, MINUTE_NS, minutes)
    for finer_ns, width_ns in pairwise(WIDTHS_NS):
        whole = (_floor(span[0], width_ns), _floor(span[1], width_ns))
        cells = select_cells(writer, series, finer_ns, whole, _columns())
        if cells is not None:
            insert_cells(writer, series, width_ns, cells.gathered(width_ns))


def _minutes(writer: Connection, series: int, span: Span) -> Cells | None:
    rows = writer.execute(SELECT_WHOLE, (series, *span)).fetchall()
    if not rows:
        return None
    summaries = decoded_rows([row[:4] for row in rows], select_layouts(writer), _columns())
    state = np.array([NO_STATE if row[4] is None else row[4] for row in rows], dtype=np.int64)
    eccentricity, oil_c = (np.array([row[i] for row in rows], dtype=np.float64) for i in (5, 6))
    return Cells(Conditions.of(state, eccentricity, oil_c), summaries).gathered(MINUTE_NS)


def insert_cells(writer: Connection, series: int, width_ns: int, cells: Cells) -> None:
    """Write roll-ups of one width, within a transaction."""
    width_s, slots = width_ns // NS_PER_S, cells.slots().tolist()
    start_ns = cells.summaries.time_ns.tolist()
    writer.executemany(INSERT_CELL, _cell_rows(series, width_s, start_ns, slots, cells.conditions))
    for part in parts_of(_columns()):
        layout = remember_layout(writer, Layout.of(part))
        numbers = encoded(cells.summaries.only(part))
        rows = zip(start_ns, slots, numbers, strict=True)
        writer.executemany(INSERT_NUMBERS, [(series, width_s, layout, *row) for row in rows])


def _cell_rows(
    series: int, width_s: int, start_ns: list[int], slots: list[int], conditions: Conditions
) -> list[tuple[object, ...]]:
    states = [None if state == NO_STATE else state for state in conditions.state.tolist()]
    extremes = (
        [None if np.isnan(value) else value for value in column.tolist()]
        for column in (
            conditions.eccentricity_low,
            conditions.eccentricity_high,
            conditions.oil_low_c,
            conditions.oil_high_c,
        )
    )
    columns = (start_ns, slots, states, conditions.n_readings.tolist(), *extremes)
    return [(series, width_s, *row) for row in zip(*columns, strict=True)]


def _forget(writer: Connection, series: int, span: Span) -> None:
    layouts = [row[0] for row in writer.execute("SELECT id FROM layout").fetchall()]
    for width_ns in WIDTHS_NS:
        its = (series, width_ns // NS_PER_S)
        writer.execute(
            "DELETE FROM rollup_cell WHERE series = ? AND width_s = ?"
            " AND start_ns >= ? AND start_ns < ?",
            (*its, *span),
        )
        writer.executemany(
            "DELETE FROM rollup_numbers WHERE series = ? AND width_s = ? AND layout = ?"
            " AND start_ns >= ? AND start_ns < ?",
            [(*its, layout, *span) for layout in layouts],
        )


def _columns() -> tuple[str, ...]:
    return columns_of(CATALOGUE)


def _floor(time_ns: int, width_ns: int) -> int:
    return time_ns - time_ns % width_ns
