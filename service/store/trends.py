"""Queries of single readings (not aggregated) by time and operating condition."""

from collections.abc import Iterable, Iterator

import numpy as np

from core.condition.operating_state import OperatingState
from core.quality import Level
from service.store.buckets import Summaries
from service.store.database import Connection
from service.store.port import QueryTooLargeError, StoreError, TrendQuery, ValueRange
from service.store.series import Layout

IN_STATES = """(
        CAST(:states AS TEXT) = '' OR CAST(:states AS TEXT) LIKE '%,' || operating_state || ',%'
    )"""
"""SQL condition that the state is in ``:states``, such as ``,2,,3,``; empty for all states."""


def at_least(column: str, name: str) -> str:
    """Return the SQL condition that a column is at least parameter `name`; NULL means no bound."""
    return f"(CAST(:{name} AS DOUBLE PRECISION) IS NULL OR {column} >= :{name})"


def at_most(column: str, name: str) -> str:
    """Return the SQL condition that a column is at most parameter `name`; NULL means no bound."""
    return f"(CAST(:{name} AS DOUBLE PRECISION) IS NULL OR {column} <= :{name})"


BETWEEN_BOUNDS = f"""{at_least("eccentricity_ratio", "eccentricity_low")}
    AND {at_most("eccentricity_ratio", "eccentricity_high")}
    AND {at_least("oil_temperature_c", "oil_low")}
    AND {at_most("oil_temperature_c", "oil_high")}"""
"""SQL condition that a single reading is within the value ranges of a query."""


def condition_arguments(
    states: Iterable[OperatingState], eccentricity_ratio: ValueRange, oil_temperature_c: ValueRange
) -> dict[str, object]:
    """Return the SQL parameters of the conditions on state, eccentricity and oil temperature."""
    return {
        "eccentricity_low": eccentricity_ratio.low,
        "eccentricity_high": eccentricity_ratio.high,
        "oil_low": oil_temperature_c.low,
        "oil_high": oil_temperature_c.high,
        "states": "".join(f",{int(state)}," for state in states),
    }


MAX_ROWS = 1_000_000
"""Maximum number of readings that one query reads, which takes a few seconds."""

ROWS_AT_ONCE = 4000
"""Number of rows fetched at a time, to limit memory."""

SELECT_ROWS = f"""
    SELECT time_ns, layout, reading_values, reading_qualities FROM assessment
    WHERE series = (SELECT id FROM series WHERE unit = :unit AND bearing = :bearing)
    AND time_ns >= :start_ns AND time_ns < :end_ns
    AND {BETWEEN_BOUNDS}
    AND {IN_STATES}
    ORDER BY time_ns LIMIT :most
"""  # noqa: S608

Span = tuple[int, int]
"""Half-open time range, ns."""

Row = tuple[int, int, bytes, bytes]
"""Stored row of readings: time in ns, layout number, encoded values and quality bytes."""


def select_page(reader: Connection, query: TrendQuery) -> Summaries:
    """Return the readings of one page, oldest first, and the first reading of the next page."""
    rows = reader.execute(SELECT_ROWS, arguments(query) | {"most": query.max_points + 1})
    return decoded_rows(rows.fetchall(), select_layouts(reader), query.quantities)


def select_readings(
    reader: Connection, query: TrendQuery, spans: Iterable[Span], width_ns: int
) -> tuple[int, Summaries]:
    """Return the number of readings in the given time spans, and the readings, oldest first.

    Parameters
    ----------
    width_ns
        Width of the buckets into which the readings are aggregated if there are more than
        ``max_points``.

    Raises
    ------
    QueryTooLargeError
        If the spans have more than `MAX_ROWS` readings.
    StoreError
        If the layout of a row is damaged or missing.
    """
    layouts = select_layouts(reader)
    n_readings, single, summed = 0, [decoded_rows([], layouts, query.quantities)], []
    for rows in _chunks(reader, query, spans):
        n_readings += len(rows)
        single.append(decoded_rows(rows, layouts, query.quantities))
        if n_readings > query.max_points:
            summed += [part.in_spans(width_ns) for part in single]
            single = []
    return n_readings, Summaries.together([*summed, *single])


def _chunks(reader: Connection, query: TrendQuery, spans: Iterable[Span]) -> Iterator[list[Row]]:
    left = MAX_ROWS
    for start_ns, end_ns in spans:
        asked = arguments(query) | {"start_ns": storable(start_ns), "end_ns": storable(end_ns)}
        while rows := reader.execute(SELECT_ROWS, asked | {"most": ROWS_AT_ONCE}).fetchall():
            left -= len(rows)
            if left < 0:
                raise too_large()
            yield rows
            if len(rows) < ROWS_AT_ONCE:
                break
            asked["start_ns"] = rows[-1][0] + 1


def too_large() -> QueryTooLargeError:
    """Return the error for a query that would read too many single readings."""
    return QueryTooLargeError(
        f"more than {MAX_ROWS} single readings would have to be read; request a shorter time range,"
        " fewer points, or bounds of eccentricity and oil temperature at whole cells"
    )


def select_layouts(reader: Connection) -> dict[int, Layout]:
    """Return all undamaged layouts by number."""
    return {
        id_: Layout.loads(quantities, reasons)
        for id_, quantities, reasons in reader.execute("SELECT * FROM whole_layout")
    }


def storable(time_ns: int) -> int:
    """Return a time, in ns, limited to the range that can be stored: from 1970 to 2262."""
    return max(0, min(time_ns, 2**63 - 1))


def arguments(query: TrendQuery) -> dict[str, object]:
    """Return the SQL parameters of a trend query."""
    return {
        "unit": query.unit,
        "bearing": query.bearing,
        "start_ns": storable(query.start_ns),
        "end_ns": storable(query.end_ns),
        **condition_arguments(query.states, query.eccentricity_ratio, query.oil_temperature_c),
    }


def decoded_rows(rows: list[Row], layouts: dict[int, Layout], names: tuple[str, ...]) -> Summaries:
    """Return the columns `names` of stored rows; a column that a row lacks has level BAD.

    Raises `StoreError` if the layout of a row is damaged or missing.
    """
    time_ns = np.array([row[0] for row in rows], dtype=np.int64)
    layout_of_row = np.array([row[1] for row in rows], dtype=np.int64)
    value = np.full((len(rows), len(names)), np.nan)
    level = np.full((len(rows), len(names)), Level.BAD, dtype=np.uint8)
    for id_ in np.unique(layout_of_row).tolist():
        if id_ not in layouts:
            raise StoreError(
                f"layout {id_} of stored readings is damaged or missing; restore a backup"
            )
        layout, where = layouts[id_], np.flatnonzero(layout_of_row == id_)
        numbers, levels = layout.decode([rows[i][2] for i in where], [rows[i][3] for i in where])
        place = {name: column for column, name in enumerate(layout.quantities)}
        known = np.array([column for column, name in enumerate(names) if name in place], np.int64)
        theirs = [place[names[column]] for column in known]
        value[np.ix_(where, known)] = numbers[:, theirs]
        level[np.ix_(where, known)] = levels[:, theirs]
    return Summaries.of(names, time_ns, value, level)
