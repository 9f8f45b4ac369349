"""The readings that a trend is made of, out of the rows of assessments."""

import sqlite3

import numpy as np

from core.quality import Level
from service.store.buckets import Readings
from service.store.codec import Layout
from service.store.port import QueryTooLargeError, TrendQuery

MAX_ROWS = 1_000_000
"""Most readings that one query may touch: about 300 MB of rows and a few seconds."""

MATCHING = """
    FROM assessment
    WHERE series = (SELECT id FROM series WHERE unit = :unit AND bearing = :bearing)
    AND time_ns >= :start_ns AND time_ns < :end_ns
    AND (:eccentricity_low IS NULL OR eccentricity_ratio >= :eccentricity_low)
    AND (:eccentricity_high IS NULL OR eccentricity_ratio <= :eccentricity_high)
    AND (:oil_low IS NULL OR oil_temperature_c >= :oil_low)
    AND (:oil_high IS NULL OR oil_temperature_c <= :oil_high)
    AND (:states = '' OR instr(:states, ',' || operating_state || ',') > 0)
"""
COUNT_ROWS = "SELECT count(*)" + MATCHING
SELECT_ROWS = (
    "SELECT time_ns, layout, reading_values, reading_qualities"
    + MATCHING
    + "ORDER BY time_ns LIMIT :most"
)


def select_readings(reader: sqlite3.Connection, query: TrendQuery) -> Readings:
    """Readings of one bearing, oldest first; of a page one more than it holds.

    Raises
    ------
    QueryTooLargeError
        If they are more than `MAX_ROWS`.
    """
    arguments = _arguments(query)
    n_rows = 0 if query.is_page else int(reader.execute(COUNT_ROWS, arguments).fetchone()[0])
    if n_rows > MAX_ROWS:
        raise QueryTooLargeError(
            f"{n_rows} readings in this range, at most {MAX_ROWS} are read at once"
        )
    rows = reader.execute(SELECT_ROWS, arguments).fetchall()
    layouts = {
        id_: Layout.loads(quantities, reasons)
        for id_, quantities, reasons in reader.execute("SELECT * FROM layout")
    }
    return _decoded(rows, layouts, query.quantities)


def storable(time_ns: int) -> int:
    """The nearest time that a row can have: from 1970 to 2262."""
    return max(0, min(time_ns, 2**63 - 1))


def _arguments(query: TrendQuery) -> dict[str, object]:
    return {
        "unit": query.unit,
        "bearing": query.bearing,
        "start_ns": storable(query.start_ns),
        "end_ns": storable(query.end_ns),
        "eccentricity_low": query.eccentricity_ratio.low,
        "eccentricity_high": query.eccentricity_ratio.high,
        "oil_low": query.oil_temperature_c.low,
        "oil_high": query.oil_temperature_c.high,
        "most": query.max_points + 1 if query.is_page else -1,
        "states": "".join(f",{int(state)}," for state in query.states),
    }


def _decoded(
    rows: list[tuple[int, int, bytes, bytes]],
    layouts: dict[int, Layout],
    quantities: tuple[str, ...],
) -> Readings:
    time_ns = np.array([row[0] for row in rows], dtype=np.int64)
    layout_of_row = np.array([row[1] for row in rows], dtype=np.int64)
    value = {name: np.full(len(rows), np.nan) for name in quantities}
    level = {name: np.full(len(rows), Level.BAD, dtype=np.uint8) for name in quantities}
    for id_ in np.unique(layout_of_row).tolist():
        layout, where = layouts[id_], np.flatnonzero(layout_of_row == id_)
        numbers, levels = layout.decode([rows[i][2] for i in where], [rows[i][3] for i in where])
        for name in set(quantities) & set(layout.quantities):
            column = layout.quantities.index(name)
            value[name][where] = numbers[:, column]
            level[name][where] = levels[:, column]
    return Readings(time_ns, value, level)
