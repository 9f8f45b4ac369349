"""Roll-ups as they are written: readings gathered by the minute, cells in their tables."""

import numpy as np

from core.monitor.catalogue import CATALOGUE
from service.store.database import Connection
from service.store.rollups.rows import (
    NO_STATE,
    NS_PER_S,
    WIDTHS_NS,
    Cells,
    Conditions,
    encoded,
    parts_of,
)
from service.store.series import Layout, columns_of, remember_layout
from service.store.trends import Span, decoded_rows, select_layouts

MINUTE_NS = WIDTHS_NS[0]

SELECT_WHOLE = """
    SELECT time_ns, layout, reading_values, reading_qualities,
    operating_state, eccentricity_ratio, oil_temperature_c
    FROM whole_assessment WHERE series = ? AND time_ns >= ? AND time_ns < ? ORDER BY time_ns
"""
INSERT_CELL = "INSERT INTO rollup_cell VALUES (?,?,?,?,?,?,?,?,?,?)"
INSERT_NUMBERS = "INSERT INTO rollup_numbers VALUES (?,?,?,?,?,?)"


def select_mark(reader: Connection, series: int) -> int:
    """Up to when the readings of a bearing have been gathered; 0 if none have."""
    found = reader.execute(
        "SELECT until_ns FROM rollup_mark WHERE series = ?", (series,)
    ).fetchone()
    return 0 if found is None else int(found[0])


def minutes_of(writer: Connection, series: int, span: Span) -> Cells | None:
    """Single readings of a span of time, gathered by the minute; None if there are none."""
    rows = writer.execute(SELECT_WHOLE, (series, *span)).fetchall()
    if not rows:
        return None
    summaries = decoded_rows([row[:4] for row in rows], select_layouts(writer), rolled_columns())
    state = np.array([NO_STATE if row[4] is None else row[4] for row in rows], dtype=np.int64)
    eccentricity, oil_c = (np.array([row[i] for row in rows], dtype=np.float64) for i in (5, 6))
    return Cells(Conditions.of(state, eccentricity, oil_c), summaries).gathered(MINUTE_NS)


def insert_cells(writer: Connection, series: int, width_ns: int, cells: Cells) -> None:
    """Write roll-ups of one width, within a transaction."""
    width_s, slots = width_ns // NS_PER_S, cells.slots().tolist()
    start_ns = cells.summaries.time_ns.tolist()
    writer.executemany(INSERT_CELL, _cell_rows(series, width_s, start_ns, slots, cells.conditions))
    for part in parts_of(rolled_columns()):
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


def forget_width(writer: Connection, series: int, width_ns: int, span: Span) -> None:
    """Delete the roll-ups of one width in a span of time."""
    layouts = [row[0] for row in writer.execute("SELECT id FROM layout").fetchall()]
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


def rolled_columns() -> tuple[str, ...]:
    """What is kept of readings in roll-ups."""
    return columns_of(CATALOGUE)
