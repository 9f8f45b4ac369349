"""Writing and deletion of roll-ups, and the times up to which data were deleted."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from core.units import NS_PER_S
from service.store.database import Connection
from service.store.rollups.rows import (
    NO_STATE,
    WIDTHS_NS,
    Cells,
    Conditions,
    encoded,
    parts_of,
)
from service.store.series import FIXED_COLUMNS, Layout, other_columns, remember_layout
from service.store.trends import Span, decoded_rows, select_layouts

MINUTE_NS = WIDTHS_NS[0]

SELECT_WHOLE = """
    SELECT time_ns, layout, reading_values, reading_qualities,
    operating_state, eccentricity_ratio, oil_temperature_c
    FROM whole_assessment WHERE series = ? AND time_ns >= ? AND time_ns < ? ORDER BY time_ns
"""
NEXT_TIMES = """
    SELECT time_ns FROM assessment WHERE series = ? AND time_ns >= ? AND time_ns < ?
    ORDER BY time_ns LIMIT ?
"""
DELETE_READINGS = "DELETE FROM assessment WHERE series = ? AND time_ns >= ? AND time_ns < ?"
INSERT_CELL = "INSERT INTO rollup_cell VALUES (?,?,?,?,?,?,?,?,?,?)"
INSERT_NUMBERS = "INSERT INTO rollup_numbers VALUES (?,?,?,?,?,?)"


def floored(time_ns: int, width_ns: int) -> int:
    """Return a time rounded down to a multiple of a width."""
    return time_ns - time_ns % width_ns


def select_mark(reader: Connection, series: int) -> int:
    """Return the time, ns since 1970 UTC, before which all readings are aggregated; 0 if none."""
    found = reader.execute(
        "SELECT until_ns FROM rollup_mark WHERE series = ?", (series,)
    ).fetchone()
    return 0 if found is None else int(found[0])


def minutes_of(writer: Connection, series: int, span: Span) -> Cells | None:
    """Return the readings of a half-open span aggregated by minute; None if it has no readings."""
    rows = writer.execute(SELECT_WHOLE, (series, *span)).fetchall()
    if not rows:
        return None
    summaries = decoded_rows(
        [row[:4] for row in rows], select_layouts(writer), rolled_columns(writer)
    )
    state = np.array([NO_STATE if row[4] is None else row[4] for row in rows], dtype=np.int64)
    eccentricity, oil_c = (np.array([row[i] for row in rows], dtype=np.float64) for i in (5, 6))
    return Cells(Conditions.of(state, eccentricity, oil_c), summaries).gathered(MINUTE_NS)


def insert_cells(writer: Connection, series: int, width_ns: int, cells: Cells) -> None:
    """Insert roll-ups of one width for a bearing."""
    width_s, slots = width_ns // NS_PER_S, cells.slots().tolist()
    start_ns = cells.summaries.time_ns.tolist()
    writer.executemany(INSERT_CELL, _cell_rows(series, width_s, start_ns, slots, cells.conditions))
    others = tuple(name for name in cells.summaries.names if name not in FIXED_COLUMNS)
    for part in (*parts_of(FIXED_COLUMNS), *parts_of(others)):
        chosen = cells.summaries.only(part)
        if part[0] not in FIXED_COLUMNS and not chosen.count.any():
            continue  # quantities of other bearings
        layout = remember_layout(writer, Layout.of(part))
        numbers = encoded(chosen)
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
    """Delete the roll-ups of one width of a bearing that start in a half-open time span."""
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


def rolled_columns(reader: Connection) -> tuple[str, ...]:
    """Return the names of the columns that roll-ups contain: those of all stored layouts."""
    layouts = select_layouts(reader).values()
    return (*FIXED_COLUMNS, *other_columns(name for each in layouts for name in each.quantities))


SINGLE_S = 0
"""Width of single readings in the table of deleted data, in seconds."""

SELECT_DELETED = "SELECT width_s, until_ns FROM retention_mark WHERE series = ?"
SET_DELETED = """
    INSERT INTO retention_mark VALUES (?, ?, ?)
    ON CONFLICT (series, width_s) DO UPDATE SET until_ns = excluded.until_ns
"""


@dataclass(frozen=True)
class DeletedUntil:
    """Times up to which data of a bearing were deleted.

    Parameters
    ----------
    until_ns
        Time in ns since 1970 UTC, by roll-up width in s (0 for single readings); earlier data no
        longer exist.
    """

    until_ns: dict[int, int]

    @property
    def readings_ns(self) -> int:
        """Time, ns since 1970 UTC, up to which single readings were deleted; 0 if never."""
        return self.of(SINGLE_S)

    def of(self, width_s: int) -> int:
        """Return the time up to which data of the width `width_s` were deleted.

        The time is in ns since 1970 UTC; 0 if no data were deleted.
        """
        return self.until_ns.get(width_s, 0)

    def kept_ns(self, time_ns: int) -> tuple[int, ...]:
        """Return the widths, in ns, of the roll-ups that still exist at `time_ns`, finest first."""
        return tuple(width for width in WIDTHS_NS if self.of(width // NS_PER_S) <= time_ns)

    def finest_ns(self, start_ns: int) -> int | None:
        """Return the finest roll-up width, ns, that exists at a time; None for single readings."""
        return self.kept_ns(start_ns)[0] if start_ns < self.readings_ns else None

    def stretches(self, span: tuple[int, int]) -> list[tuple[int, int]]:
        """Return the parts of a time span, split at the times up to which data were deleted."""
        cuts = sorted({*span, *(t for t in self.until_ns.values() if span[0] < t < span[1])})
        return list(pairwise(cuts))


def select_deleted(reader: Connection, series: int) -> DeletedUntil:
    """Return the times up to which data of a bearing were deleted."""
    return DeletedUntil(
        {int(width): int(until) for width, until in reader.execute(SELECT_DELETED, (series,))}
    )


def set_deleted(writer: Connection, series: int, width_s: int, until_ns: int) -> None:
    """Write the time, ns since 1970 UTC, up to which data of a width are deleted."""
    writer.execute(SET_DELETED, (series, width_s, until_ns))
