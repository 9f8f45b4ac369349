"""Roll-ups out of their tables: which cells there are in a span of time, and their numbers."""

from collections.abc import Iterable, Mapping

import numpy as np
import numpy.typing as npt

from core.quality import Level
from service.store.codec import Layout
from service.store.conditions import IN_STATES, at_least, at_most
from service.store.database import Connection
from service.store.rollups.cells import NO_STATE, Cells, Conditions
from service.store.rollups.codec import decoded
from service.store.rollups.widths import NS_PER_S
from service.store.summaries import IntArray, Summaries
from service.store.trends import Span, select_layouts

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
SELECT_CELLS = f"""
    SELECT start_ns, slot, operating_state, n_readings,
    eccentricity_low, eccentricity_high, oil_low_c, oil_high_c
    FROM whole_rollup_cell AS cell WHERE {OVERLAPPING} ORDER BY start_ns, slot
"""  # noqa: S608
SELECT_ALL_NUMBERS = """
    SELECT start_ns, slot, numbers FROM whole_rollup_numbers
    WHERE series = :series AND width_s = :width_s AND layout = :layout
    AND start_ns >= :start_ns AND start_ns < :end_ns ORDER BY start_ns, slot
"""
SELECT_SOME_NUMBERS = f"""
    SELECT cell.start_ns, cell.slot, numbers
    FROM whole_rollup_cell AS cell CROSS JOIN whole_rollup_numbers AS n ON n.series = cell.series
    AND n.width_s = cell.width_s AND n.layout = :layout
    AND n.start_ns = cell.start_ns AND n.slot = cell.slot
    WHERE {OVERLAPPING} ORDER BY cell.start_ns, cell.slot
"""  # noqa: S608

MOST_SLOTS = 1 << 20


def select_cells(
    reader: Connection,
    series: int,
    width_ns: int,
    span: Span,
    names: tuple[str, ...],
    asked: Mapping[str, object] = ANYTHING,
) -> Cells | None:
    """Cells that readings which are asked for may be in; None if there are none.

    Parameters
    ----------
    names
        Columns that are wanted.
    asked
        Bounds of the conditions.
    """
    wanted = {**asked, "series": series, "width_s": width_ns // NS_PER_S}
    wanted |= {"start_ns": span[0], "end_ns": span[1]}
    rows = reader.execute(SELECT_CELLS, wanted).fetchall() if span[0] < span[1] else []
    if not rows:
        return None
    start_ns, slot = (np.array([row[i] for row in rows], dtype=np.int64) for i in (0, 1))
    places = start_ns // width_ns * MOST_SLOTS + slot
    statement = SELECT_ALL_NUMBERS if asked == ANYTHING else SELECT_SOME_NUMBERS
    summaries = _nothing(names, start_ns)
    for id_, layout in select_layouts(reader).items():
        if set(layout.quantities) & set(names):
            found = reader.execute(statement, wanted | {"layout": id_}).fetchall()
            _put(summaries, layout, places, width_ns, found)
    return Cells(_conditions(rows), summaries)


def _conditions(rows: Iterable[tuple[object, ...]]) -> Conditions:
    columns = list(zip(*rows, strict=True))
    extremes = (np.array(column, dtype=np.float64) for column in columns[4:])
    states = [NO_STATE if state is None else state for state in columns[2]]
    return Conditions(
        np.array(states, dtype=np.int64), np.array(columns[3], dtype=np.int64), *extremes
    )


def _nothing(names: tuple[str, ...], start_ns: IntArray) -> Summaries:
    """Readings of quantities that nobody knew at the time."""
    value = np.full((start_ns.size, len(names)), np.nan)
    level = np.full(value.shape, Level.BAD, dtype=np.uint8)
    count = np.zeros(value.shape, dtype=np.int64)
    return Summaries(names, start_ns, count, value, value.copy(), value.copy(), level)


def _put(
    into: Summaries,
    layout: Layout,
    places: IntArray,
    width_ns: int,
    rows: list[tuple[int, int, bytes]],
) -> None:
    """Put the columns of one layout where they belong."""
    if not rows:
        return
    start_ns, slot = (np.array([row[i] for row in rows], dtype=np.int64) for i in (0, 1))
    wanted = start_ns // width_ns * MOST_SLOTS + slot
    where = np.searchsorted(places, wanted)
    has_cell = np.flatnonzero(np.take(places, where, mode="clip") == wanted)  # or it is damaged
    where, start_ns = where[has_cell], start_ns[has_cell]
    part = decoded(layout.quantities, start_ns, [rows[i][2] for i in has_cell])
    theirs = [column for column, name in enumerate(layout.quantities) if name in into.names]
    own = np.array([into.names.index(layout.quantities[column]) for column in theirs], np.int64)
    for name in ("count", "mean", "minimum", "maximum", "level"):
        target: npt.NDArray[np.generic] = getattr(into, name)
        target[np.ix_(where, own)] = getattr(part, name)[:, theirs]
