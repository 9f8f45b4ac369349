"""Roll-up rows by operating condition: aggregation, encoding, tables and queries."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.condition.cells import CellGrid
from core.quality import Level
from core.units import NS_PER_S
from service.store.buckets import IntArray, Summaries
from service.store.database import Connection
from service.store.seals import select_whole, unchecked
from service.store.series import Layout
from service.store.trends import IN_STATES, Span, at_least, at_most, select_layouts

NO_STATE = -1
NO_BIN = np.iinfo(np.int64).min
GRID = CellGrid()
"""Grid of operating condition cells; roll-ups aggregate readings of the same cell."""


@dataclass(frozen=True)
class Conditions:
    """Operating conditions of n single or aggregated readings.

    Parameters
    ----------
    state : (n,)
        Operating state, `NO_STATE` if unknown.
    n_readings : (n,)
        Number of aggregated readings, usable or not.
    eccentricity_low, eccentricity_high : (n,)
        Minimum and maximum of the eccentricity ratio, NaN if unknown.
    oil_low_c, oil_high_c : (n,)
        Minimum and maximum of the oil temperature in °C, NaN if unknown.
    """

    state: IntArray
    n_readings: IntArray
    eccentricity_low: FloatArray
    eccentricity_high: FloatArray
    oil_low_c: FloatArray
    oil_high_c: FloatArray

    @classmethod
    def of(cls, state: IntArray, eccentricity: FloatArray, oil_c: FloatArray) -> "Conditions":
        """Return the conditions of n single readings, given in arrays of shape (n,)."""
        one = np.ones(state.size, dtype=np.int64)
        return cls(state, one, eccentricity, eccentricity, oil_c, oil_c)

    def summed(self, order: IntArray, starts: IntArray) -> "Conditions":
        """Return the aggregate of each run of rows that have the same time span and cell.

        Parameters
        ----------
        order : (n,)
            Row indices that sort the rows by time span and cell.
        starts : (m,)
            Position in `order` of the first row of each run.
        """
        return Conditions(
            self.state[order][starts],
            np.add.reduceat(self.n_readings[order], starts),
            np.fmin.reduceat(self.eccentricity_low[order], starts),
            np.fmax.reduceat(self.eccentricity_high[order], starts),
            np.fmin.reduceat(self.oil_low_c[order], starts),
            np.fmax.reduceat(self.oil_high_c[order], starts),
        )


@dataclass(frozen=True)
class Cells:
    """Roll-up cells in order of time: statistics of readings with their operating conditions.

    The readings of a cell are of one time span, and similar in state, eccentricity and temperature.
    """

    conditions: Conditions
    summaries: Summaries

    def gathered(self, width_ns: int) -> "Cells":
        """Return the cells aggregated over time spans of `width_ns`, in order of time."""
        bucket = self.summaries.time_ns // width_ns
        keys = np.stack(
            [
                bins(self.conditions.oil_low_c, GRID.temperature_width_c),
                bins(self.conditions.eccentricity_low, GRID.eccentricity_width),
                self.conditions.state,
                bucket,
            ]
        )
        order = np.lexsort(keys)  # stable: in order of time within a cell
        is_first = np.any(np.diff(keys[:, order], axis=1) != 0, axis=0)
        starts = np.flatnonzero(np.concatenate([[True], is_first]))
        times = bucket[order][starts] * width_ns
        return Cells(
            self.conditions.summed(order, starts), self.summaries.at(order).summed(starts, times)
        )

    def slots(self) -> IntArray:
        """Return the index of each cell among the cells of its time span; shape (n,)."""
        time_ns = self.summaries.time_ns
        first = np.flatnonzero(np.concatenate([[True], np.diff(time_ns) != 0]))
        lengths = np.diff(np.append(first, time_ns.size))
        return np.arange(time_ns.size) - np.repeat(first, lengths)


def together(one: Cells, other: Cells) -> Cells:
    """Return the concatenated rows of two sets of cells; `Cells.gathered` restores the order."""
    conditions = Conditions(
        *(
            np.concatenate([getattr(one.conditions, name), getattr(other.conditions, name)])
            for name in (field.name for field in fields(Conditions))
        )
    )
    return Cells(conditions, Summaries.joined([one.summaries, other.summaries]))


def bins(value: FloatArray, width: float) -> IntArray:
    """Return the bin numbers of values (n,), `NO_BIN` for NaN; edges are multiples of `width`."""
    known = np.isfinite(value)
    safe = np.clip(np.where(known, value, 0.0), -1e9, 1e9)
    number = np.floor(safe / width).astype(np.int64)
    number += safe >= np.round((number + 1) * width, 9)
    number -= safe < np.round(number * width, 9)
    return np.where(known, number, NO_BIN)


PART_COLUMNS = 24
"""Number of columns per part; a row of a part fits in a database page without overflow pages."""


def parts_of(columns: tuple[str, ...]) -> tuple[tuple[str, ...], ...]:
    """Return columns, split into parts of at most `PART_COLUMNS` adjacent columns."""
    return tuple(
        columns[first : first + PART_COLUMNS] for first in range(0, len(columns), PART_COLUMNS)
    )


def encoded(summaries: Summaries) -> list[bytes]:
    """Return each row of roll-up statistics as a binary record."""
    usable = summaries.count > 0
    packed = np.packbits(usable, axis=1)
    found: list[bytes] = [b""] * len(packed)
    for pattern, rows in _alike([bits.tobytes() for bits in packed]):
        columns = np.flatnonzero(usable[rows[0]])
        record = np.empty(rows.size, dtype=_record(len(summaries.names), columns.size))
        record["level"] = summaries.level[rows]
        record["usable"] = np.frombuffer(pattern, dtype=np.uint8)
        chosen = np.ix_(rows, columns)
        record["count"] = np.minimum(summaries.count[chosen], np.iinfo(np.uint32).max)
        record["mean"], record["minimum"] = summaries.mean[chosen], summaries.minimum[chosen]
        record["maximum"] = summaries.maximum[chosen]
        for row, one in zip(rows.tolist(), record, strict=True):
            found[row] = one.tobytes()
    return found


def _record(n_columns: int, n_usable: int) -> np.dtype[np.void]:
    return np.dtype(
        [
            ("level", np.uint8, (n_columns,)),
            ("usable", np.uint8, (-(-n_columns // 8),)),
            ("count", "<u4", (n_usable,)),
            ("mean", "<f8", (n_usable,)),
            ("minimum", "<f8", (n_usable,)),
            ("maximum", "<f8", (n_usable,)),
        ]
    )


def _alike(patterns: list[bytes]) -> list[tuple[bytes, npt.NDArray[np.int64]]]:
    if patterns and patterns.count(patterns[0]) == len(patterns):
        return [(patterns[0], np.arange(len(patterns)))]
    rows: dict[bytes, list[int]] = {}
    for row, pattern in enumerate(patterns):
        rows.setdefault(pattern, []).append(row)
    return [(pattern, np.array(found)) for pattern, found in rows.items()]


ROLLUP_TABLES = """
    CREATE TABLE rollup_cell (
        series INTEGER NOT NULL REFERENCES series (id),
        width_s INTEGER NOT NULL,
        start_ns INTEGER NOT NULL,
        slot INTEGER NOT NULL,
        operating_state INTEGER,
        n_readings INTEGER NOT NULL CHECK (n_readings > 0),
        eccentricity_low REAL,
        eccentricity_high REAL,
        oil_low_c REAL,
        oil_high_c REAL,
        PRIMARY KEY (series, width_s, start_ns, slot)
    ) STRICT, WITHOUT ROWID;
    CREATE TABLE rollup_numbers (
        series INTEGER NOT NULL REFERENCES series (id),
        width_s INTEGER NOT NULL,
        layout INTEGER NOT NULL REFERENCES layout (id),
        start_ns INTEGER NOT NULL,
        slot INTEGER NOT NULL,
        numbers BLOB NOT NULL,
        PRIMARY KEY (series, width_s, layout, start_ns, slot)
    ) STRICT, WITHOUT ROWID;
    CREATE TABLE rollup_mark (
        series INTEGER PRIMARY KEY REFERENCES series (id),
        until_ns INTEGER NOT NULL
    ) STRICT;
    CREATE TABLE rollup_redo (
        series INTEGER NOT NULL REFERENCES series (id),
        start_ns INTEGER NOT NULL,
        PRIMARY KEY (series, start_ns)
    ) STRICT, WITHOUT ROWID;
    CREATE TRIGGER rollup_of_a_late_reading AFTER INSERT ON assessment
    WHEN NEW.time_ns < (SELECT until_ns FROM rollup_mark WHERE series = NEW.series)
    BEGIN
        INSERT INTO rollup_redo
        VALUES (NEW.series, NEW.time_ns - NEW.time_ns % 3600000000000)
        ON CONFLICT DO NOTHING;
    END;
"""
"""Migration that creates the tables of roll-ups.

A late reading, whose time is already aggregated, is inserted together with a row in
``rollup_redo``. Roll-ups of that hour are not read until the hour is aggregated again."""


WIDTHS_S = (60, 600, 3600)
"""Roll-up widths in seconds, finest first. Each width divides the next one; hours with late
readings are aggregated again as a whole."""

WIDTHS_NS = tuple(width * NS_PER_S for width in WIDTHS_S)
HOUR_NS = WIDTHS_NS[-1]


ANYTHING: Mapping[str, object] = {
    "eccentricity_low": None,
    "eccentricity_high": None,
    "oil_low": None,
    "oil_high": None,
    "states": "",
}

OVERLAPPING = f"""
    cell.series = :series AND cell.width_s = :width_s
    AND cell.start_ns >= :start_ns AND cell.start_ns < :end_ns
    AND {IN_STATES}
    AND {at_least("cell.eccentricity_high", "eccentricity_low")}
    AND {at_most("cell.eccentricity_low", "eccentricity_high")}
    AND {at_least("cell.oil_high_c", "oil_low")}
    AND {at_most("cell.oil_low_c", "oil_high")}
"""
IN_SPAN = """
    series = :series AND width_s = :width_s AND start_ns >= :start_ns AND start_ns < :end_ns
    ORDER BY start_ns, slot
"""
SELECT_CELLS = f"""
    SELECT cell.* FROM whole_rollup_cell AS cell WHERE {OVERLAPPING} ORDER BY start_ns, slot
"""  # noqa: S608
SELECT_PLACES = "SELECT start_ns, slot, n_readings FROM"
SELECT_NUMBERS = f"""
    SELECT n.*
    FROM whole_rollup_cell AS cell CROSS JOIN whole_rollup_numbers AS n ON n.series = cell.series
    AND n.width_s = cell.width_s AND n.layout = :layout
    AND n.start_ns = cell.start_ns AND n.slot = cell.slot
    WHERE {OVERLAPPING} ORDER BY cell.start_ns, cell.slot
"""  # noqa: S608

MOST_SLOTS = 1 << 20

ROWS_AT_ONCE = 2000
"""Number of rows that are decoded together; more of them do not fit into the processor's cache."""


def select_cells(
    reader: Connection,
    series: int,
    width_ns: int,
    span: Span,
    names: tuple[str, ...],
    asked: Mapping[str, object] = ANYTHING,
    *,
    has_conditions: bool = True,
) -> Cells | None:
    """Return the cells of a time span that may contain requested readings; None without cells.

    Parameters
    ----------
    span
        Half-open range of the start times of the cells, in ns since 1970 UTC.
    names
        Requested columns.
    asked
        Bounds of the operating conditions, by SQL parameter.
    has_conditions
        Whether the operating conditions of the cells are read; otherwise they are unknown.
    """
    series_of = {"series": series, "width_s": width_ns // NS_PER_S}
    is_all = asked == ANYTHING

    def read(table: str, select: str, span: Span, **more: int) -> list[tuple[Any, ...]]:
        wanted = {**series_of, "start_ns": span[0], "end_ns": span[1], **more}
        if not is_all:
            return reader.execute(select, {**asked, **wanted}).fetchall()
        where = "WHERE " + "".join(f"{name} = :{name} AND " for name in more) + IN_SPAN
        if select is SELECT_PLACES:
            return reader.execute(f"{select} {unchecked(reader, table)} {where}", wanted).fetchall()
        return select_whole(reader, table, where, wanted)

    select = SELECT_CELLS if has_conditions else SELECT_PLACES
    rows = read("rollup_cell", select, span) if span[0] < span[1] else []
    if not rows:
        return None
    columns = list(zip(*rows, strict=True))
    start, slot = columns[2:4] if has_conditions else columns[:2]
    start_ns = np.array(start)
    places = start_ns // width_ns * MOST_SLOTS + np.array(slot)
    summaries, n_found = _nothing(names, start_ns), np.zeros(len(rows), dtype=np.int64)
    edges = [*dict.fromkeys(start[::ROWS_AT_ONCE]), span[1]]
    n_unknown = 0
    for id_, layout in select_layouts(reader).items():
        if set(layout.quantities) & set(names):
            for part in pairwise(edges):
                found = read("rollup_numbers", SELECT_NUMBERS, part, layout=id_)
                where = _put(summaries, layout, places, width_ns, found)
                n_found[where] += 1
                n_unknown += len(found) - where.size
    if not has_conditions:
        if n_unknown or not n_found.all():  # a cell may be damaged
            return select_cells(reader, series, width_ns, span, names, asked)
        unknown = np.full(len(rows), np.nan)
        states = np.full(len(rows), NO_STATE)
        return Cells(Conditions(states, np.array(columns[2]), *[unknown] * 4), summaries)
    state, n_readings, *bounds = columns[4:]
    states = np.array([NO_STATE if each is None else each for each in state], dtype=np.int64)
    extremes = (np.array(column, dtype=np.float64) for column in bounds)
    return Cells(Conditions(states, np.array(n_readings, dtype=np.int64), *extremes), summaries)


def _nothing(names: tuple[str, ...], start_ns: IntArray) -> Summaries:
    value = np.full((start_ns.size, len(names)), np.nan)
    level = np.full(value.shape, Level.BAD, dtype=np.uint8)
    count = np.zeros(value.shape, dtype=np.int64)
    return Summaries(names, start_ns, count, value, value.copy(), value.copy(), level)


def _put(
    into: Summaries,
    layout: Layout,
    places: IntArray,
    width_ns: int,
    rows: list[tuple[Any, ...]],
) -> IntArray:
    """Decode rows of one layout into the statistics; return the indices of their cells."""
    if not rows:
        return np.zeros(0, dtype=np.int64)
    *_, start_ns, slot, found = zip(*rows, strict=True)
    wanted = np.array(start_ns) // width_ns * MOST_SLOTS + np.array(slot)
    where = np.searchsorted(places, wanted)
    has_cell = np.flatnonzero(np.take(places, where, mode="clip") == wanted)
    numbers = found if has_cell.size == len(found) else [found[i] for i in has_cell.tolist()]
    own_of = {name: column for column, name in enumerate(into.names)}
    theirs = np.array([n for n, name in enumerate(layout.quantities) if name in own_of], np.int64)
    own = np.array([own_of[layout.quantities[column]] for column in theirs], np.int64)
    n_head = len(layout.quantities)
    n_bits = -(-n_head // 8)
    for pattern, alike in _alike([row[n_head : n_head + n_bits] for row in numbers]):
        usable = np.unpackbits(np.frombuffer(pattern, dtype=np.uint8), count=n_head).astype(bool)
        stored, known = np.flatnonzero(usable), usable[theirs]
        records = numbers if alike.size == len(numbers) else [numbers[row] for row in alike]
        record = np.frombuffer(b"".join(records), dtype=_record(n_head, stored.size))
        at: Any = where[has_cell[alike]]
        if at[-1] - at[0] == at.size - 1:
            at = slice(at[0], at[-1] + 1)
        columns = np.searchsorted(stored, theirs[known])
        # one column at a time is several times as fast as indexing by two arrays
        for column, of in zip(own, theirs, strict=True):
            into.level[at, column] = record["level"][:, of]
        for name in ("count", "mean", "minimum", "maximum"):
            values, read = getattr(into, name), record[name]
            for column, of in zip(own[known], columns, strict=True):
                values[at, column] = read[:, of]
    matched: IntArray = where[has_cell]
    return matched
