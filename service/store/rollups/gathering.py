"""Aggregation of readings into roll-ups, in short transactions."""

from itertools import pairwise

from service.store.database import Connection, Tables
from service.store.rollups.rows import HOUR_NS, WIDTHS_NS, select_cells, together
from service.store.rollups.writing import (
    DELETE_READINGS,
    MINUTE_NS,
    NEXT_TIMES,
    DeletedUntil,
    floored,
    forget_width,
    insert_cells,
    minutes_of,
    rolled_columns,
    select_deleted,
    select_mark,
)
from service.store.trends import Span


def _merge_late(writer: Connection, series: int, hour_ns: int, deleted: DeletedUntil) -> None:
    """Merge late readings into the roll-ups of an hour whose single readings were deleted.

    The late readings are deleted in the same transaction, so that a late reading is either stored
    or merged. A reading that is written twice after the deletion of its hour is counted twice,
    since padwatch cannot recognize the repetition.
    """
    hour = (hour_ns, hour_ns + HOUR_NS)
    minutes = minutes_of(writer, series, hour)
    if minutes is None:
        return
    for width_ns in deleted.kept_ns(hour_ns):
        late = minutes.gathered(width_ns)
        before = select_cells(writer, series, width_ns, hour, rolled_columns(writer))
        forget_width(writer, series, width_ns, hour)
        all_ = late if before is None else together(before, late).gathered(width_ns)
        insert_cells(writer, series, width_ns, all_)
    writer.execute(DELETE_READINGS, (series, *hour))


MAX_READINGS = 2000
"""Maximum number of readings per step; a step blocks other writers for tens of milliseconds."""

MAX_REDONE = 24
"""Maximum number of hours that are aggregated again per step."""

SET_MARK = """
    INSERT INTO rollup_mark VALUES (?, ?)
    ON CONFLICT (series) DO UPDATE SET until_ns = excluded.until_ns
"""


def _gather_next(writer: Connection, series: int, now_ns: int) -> None:
    """Aggregate readings of a bearing into roll-ups: the next complete minutes before `now_ns`."""
    mark_ns = select_mark(writer, series)
    until_ns = _until(writer, series, mark_ns, now_ns)
    if until_ns > mark_ns:
        _gather(writer, series, (mark_ns, until_ns))
        writer.execute(SET_MARK, (series, until_ns))


def _gather_again(writer: Connection, series: int) -> None:
    """Repeat the aggregation of hours of a bearing for which readings were stored late."""
    mark_ns = select_mark(writer, series)
    hours = writer.execute(
        "SELECT start_ns FROM rollup_redo WHERE series = ? ORDER BY start_ns LIMIT ?",
        (series, MAX_REDONE),
    ).fetchall()
    deleted = select_deleted(writer, series)
    for (hour_ns,) in hours:
        if hour_ns < deleted.readings_ns:
            _merge_late(writer, series, hour_ns, deleted)
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
    """Return the end of the next step; a minute is complete once a later minute has a reading."""
    end_ns = now_ns + 1
    times = writer.execute(NEXT_TIMES, (series, mark_ns, end_ns, MAX_READINGS)).fetchall()
    if not times:
        return mark_ns
    first_ns, last_ns = (floored(time[0], MINUTE_NS) for time in (times[0], times[-1]))
    is_one_minute = len(times) == MAX_READINGS and last_ns == first_ns
    return first_ns + MINUTE_NS if is_one_minute else max(mark_ns, last_ns)


def _gather(writer: Connection, series: int, span: Span) -> None:
    """Aggregate a span: insert the roll-ups of every width that end within it."""
    minutes = minutes_of(writer, series, span)
    if minutes is not None:
        insert_cells(writer, series, MINUTE_NS, minutes)
    for finer_ns, width_ns in pairwise(WIDTHS_NS):
        whole = (floored(span[0], width_ns), floored(span[1], width_ns))
        cells = select_cells(writer, series, finer_ns, whole, rolled_columns(writer))
        if cells is not None:
            insert_cells(writer, series, width_ns, cells.gathered(width_ns))


DUE = """
    SELECT id FROM (
        SELECT id, coalesce(until_ns, 0) AS until_ns, (
            SELECT time_ns FROM assessment WHERE series = id AND time_ns <= :now_ns
            ORDER BY time_ns DESC LIMIT 1
        ) AS newest_ns
        FROM series LEFT JOIN rollup_mark ON rollup_mark.series = id
    ) AS bearing
    WHERE newest_ns - newest_ns % :width_ns > until_ns
    OR id IN (SELECT series FROM rollup_redo)
    ORDER BY until_ns
"""


class RollupStore(Tables):
    """Store of roll-ups; readings that are not aggregated yet are read as single readings."""

    def due(self, now_ns: int) -> list[int]:
        """Return the series ids of bearings with readings to aggregate, longest delayed first."""
        with self._reading() as reader:
            rows = reader.execute(DUE, {"now_ns": now_ns, "width_ns": MINUTE_NS})
            return [int(row[0]) for row in rows]

    def gather(self, series: int, now_ns: int) -> None:
        """Aggregate some readings of one bearing in a short transaction.

        Raises `StoreError` if the transaction failed; nothing was aggregated.
        """
        with self._writing() as writer:
            _gather_again(writer, series)
            _gather_next(writer, series, now_ns)
