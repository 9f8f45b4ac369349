"""Retention: rules for the deletion of old results and roll-ups.

A new rule of a bearing consists of a setting in `RetentionSettings` and an entry in
`BEARING_RULES`.

Readings and roll-ups are deleted in small steps. Before a deletion, all wider roll-ups are compared
with roll-ups recomputed from the data. An hour that differs is aggregated again if its readings are
still stored.
"""

from collections.abc import Callable, Mapping
from enum import Enum
from functools import partial
from itertools import pairwise

import numpy as np

from core.units import DAY_NS, NS_PER_S
from service.settings.storage import RetentionSettings
from service.store.database import Connect, Connection, Reading, Tables
from service.store.rollups.rows import HOUR_NS, WIDTHS_NS, Cells, select_cells
from service.store.rollups.writing import (
    DELETE_READINGS,
    NEXT_TIMES,
    SINGLE_S,
    floored,
    forget_width,
    minutes_of,
    rolled_columns,
    select_deleted,
    select_mark,
    set_deleted,
)
from service.store.trends import Span

MAX_READINGS = 1000
"""Maximum number of readings per step; a step blocks other writers for tens of milliseconds."""

MAX_HOURS = 6
"""Maximum number of hours of roll-ups that are deleted per step."""

MAX_FILM_READINGS = 5000
MAX_MESSAGES = 500

MEAN_TOLERANCE = 1e-9
"""Tolerance of means relative to the larger extreme; rounding depends on the summation order."""

NEXT_CELL = """
    SELECT start_ns FROM rollup_cell
    WHERE series = ? AND width_s = ? AND start_ns >= ? AND start_ns < ?
    ORDER BY start_ns LIMIT 1
"""
REDONE = "SELECT start_ns FROM rollup_redo WHERE series = ? AND start_ns >= ? AND start_ns < ?"
REDO = "INSERT INTO rollup_redo VALUES (?, ?) ON CONFLICT DO NOTHING"
OLD_FILM_READINGS = """
    SELECT estimator, time_ns FROM film_reading WHERE series = ? AND time_ns < ? LIMIT ?
"""
DELETE_FILM_READING = "DELETE FROM film_reading WHERE series = ? AND estimator = ? AND time_ns = ?"
OLD_MESSAGES = """
    SELECT id FROM outbox AS old WHERE state <> 'waiting' AND done_ns < ? AND EXISTS (
        SELECT 1 FROM outbox AS newer WHERE newer.receiver = old.receiver
        AND newer.alarm = old.alarm AND newer.state = old.state AND newer.id > old.id
    ) AND NOT EXISTS (
        SELECT 1 FROM alarm_event WHERE alarm_event.alarm = old.alarm
        AND alarm_event.number = old.number AND alarm_event.time_ns >= ?
    ) ORDER BY id LIMIT ?
"""
"""Query of old messages. It excludes the last message about each alarm, on which later messages
depend, and messages about recent events: their stored sending time may be too early if the host
clock started in 1970."""

DELETE_MESSAGE = "DELETE FROM outbox WHERE id = ?"
BELIEVED = """
    SELECT max(start_ns) FROM (SELECT (
        SELECT start_ns FROM rollup_cell
        WHERE rollup_cell.series = series.id AND width_s = ?
        GROUP BY start_ns ORDER BY start_ns DESC LIMIT 1 OFFSET ?
    ) AS start_ns FROM series) AS believed
"""
BELIEVED_HOURS = (HOUR_NS // NS_PER_S, 23)
"""Parameters of `BELIEVED`: roll-up width, and offset of the 24th newest hour with results.
The query has no DISTINCT, with which SQLite 3.40 returns the oldest hour of fewer than 24."""


class Step(Enum):
    """Result of one deletion step."""

    NONE = "none"
    """No rows are due for deletion."""

    DONE = "done"
    """Rows were deleted."""

    BLOCKED = "blocked"
    """Rows are due but cannot be deleted."""


def _delete_readings(writer: Connection, series: int, before_ns: int) -> Step:
    """Delete the next single readings of a bearing before a time, in whole hours."""
    deleted = select_deleted(writer, series)
    limit_ns = floored(min(before_ns, select_mark(writer, series)), HOUR_NS)
    span = _next_readings(writer, series, (deleted.readings_ns, limit_ns))
    end_ns = _verified_until(writer, series, span)
    if end_ns <= span[0]:
        return Step.NONE
    writer.execute(DELETE_READINGS, (series, span[0], end_ns))
    set_deleted(writer, series, SINGLE_S, end_ns)
    return Step.DONE


def _delete_rollups(width_s: int, writer: Connection, series: int, before_ns: int) -> Step:
    """Delete the next roll-ups of one width of a bearing before a time.

    Roll-ups that differ from wider roll-ups are kept, and so are all later ones of the same width.
    They cannot be aggregated again, since finer data are deleted, and only one time is stored per
    width up to which data were deleted.
    """
    width_ns, deleted = width_s * NS_PER_S, select_deleted(writer, series)
    finer_s = {wider // NS_PER_S: finer // NS_PER_S for finer, wider in pairwise((0, *WIDTHS_NS))}
    limit_ns = floored(min(before_ns, deleted.of(finer_s[width_s])), HOUR_NS)
    span = _next_cells(writer, series, width_s, (deleted.of(width_s), limit_ns))
    if span[0] >= span[1] or writer.execute(REDONE, (series, *span)).fetchone():
        return Step.NONE  # late readings are merged first
    fine = select_cells(writer, series, width_ns, span, rolled_columns(writer))
    wider_ns = [wider for wider in WIDTHS_NS if wider > width_ns]
    if fine is None or not all(_agrees(writer, series, fine, w, span) for w in wider_ns):
        return Step.BLOCKED
    forget_width(writer, series, width_ns, span)
    set_deleted(writer, series, width_s, span[1])
    return Step.DONE


def _delete_films(writer: Connection, series: int, before_ns: int) -> Step:
    old = writer.execute(OLD_FILM_READINGS, (series, before_ns, MAX_FILM_READINGS)).fetchall()
    writer.executemany(DELETE_FILM_READING, [(series, *row) for row in old])
    return Step.DONE if old else Step.NONE


BEARING_RULES: Mapping[str, Callable[[Connection, int, int], Step]] = {
    "readings_days": _delete_readings,
    "minutes_days": partial(_delete_rollups, 60),
    "ten_minutes_days": partial(_delete_rollups, 600),
    "films_days": _delete_films,
}
"""Functions that delete data of a bearing older than a time, by age setting; finest first."""

Ages = Mapping[str, int]
"""Maximum age of data in ns, by name of the setting; data without an entry are never deleted."""


def ages_of(settings: RetentionSettings) -> Ages:
    """Return the maximum age of data by setting; data with a setting of 0 days have none."""
    return {name: round(days * DAY_NS) for name, days in settings if days > 0.0}


class RetentionStore(Tables):
    """Store that deletes old data in small, atomic steps.

    Parameters
    ----------
    give_back
        Function that releases free pages to the file system; returns False if none were released.
    """

    def __init__(
        self, writing: Connect, reading: Reading, give_back: Callable[[], bool] = lambda: False
    ) -> None:
        super().__init__(writing, reading)
        self.give_back = give_back
        self._blocked: set[tuple[str, int]] = set()

    @property
    def trouble(self) -> str | None:
        """Reason why some old data cannot be deleted; None if all data can be deleted."""
        if not self._blocked:
            return None
        setting, series = min(self._blocked)
        return (
            f"roll-ups with series id {series} are damaged or disagree with wider ones, so they are"
            f" kept beyond {setting} (number of such cases: {len(self._blocked)})"
        )

    def series(self) -> list[int]:
        """Return the series ids of all bearings with stored data, in ascending order."""
        with self._reading() as reader:
            return [int(row[0]) for row in reader.execute("SELECT id FROM series ORDER BY id")]

    def believed_ns(self) -> int | None:
        """Return the start of the 24th newest hour with results, in ns since 1970 UTC.

        Hours are counted per bearing; the latest start of all bearings is returned. None if no
        bearing has 24 hours with results.
        """
        with self._reading() as reader:
            found: int | None = reader.execute(BELIEVED, BELIEVED_HOURS).fetchone()[0]
        return found

    def delete(self, series: int, ages: Ages, now_ns: int) -> bool:
        """Delete a limited part of the old data of a bearing; return whether any were deleted.

        Data are old if they exceed their maximum age in `ages` at the time `now_ns`. Roll-ups that
        disagree with wider ones are kept and reported by `trouble`.

        Raises
        ------
        StoreError
            If a transaction failed; it deleted nothing.
        """
        found = False
        for setting, rule in BEARING_RULES.items():
            if setting in ages:
                with self._writing() as writer:
                    step = rule(writer, series, now_ns - ages[setting])
                found |= step is Step.DONE
                self._blocked.discard((setting, series))
                if step is Step.BLOCKED:
                    self._blocked.add((setting, series))
        return found

    def prune(self, ages: Ages, now_ns: int) -> bool:
        """Delete a limited part of the messages that exceed their maximum age at `now_ns`.

        Returns whether more old messages may be left.
        """
        if "messages_days" not in ages:
            return False
        before_ns = now_ns - ages["messages_days"]
        with self._writing() as writer:
            old = writer.execute(OLD_MESSAGES, (before_ns, before_ns, MAX_MESSAGES)).fetchall()
            writer.executemany(DELETE_MESSAGE, old)
        return len(old) == MAX_MESSAGES


def _next_readings(writer: Connection, series: int, within: Span) -> Span:
    """Return the span of the next whole hours with readings; empty span without readings."""
    rows = writer.execute(NEXT_TIMES, (series, *within, MAX_READINGS)).fetchall()
    if not rows:
        return within[0], within[0]
    first_ns, last_ns = (floored(row[0], HOUR_NS) for row in (rows[0], rows[-1]))
    is_cut = len(rows) == MAX_READINGS and last_ns > first_ns
    return first_ns, last_ns if is_cut else last_ns + HOUR_NS


def _next_cells(writer: Connection, series: int, width_s: int, within: Span) -> Span:
    row = writer.execute(NEXT_CELL, (series, width_s, *within)).fetchone()
    if row is None:
        return within[0], within[0]
    first_ns = floored(row[0], HOUR_NS)
    return first_ns, min(first_ns + MAX_HOURS * HOUR_NS, within[1])


def _verified_until(writer: Connection, series: int, span: Span) -> int:
    """Return the end of the hours that agree with their roll-ups.

    The first hour that differs is scheduled for aggregation.
    """
    redone = {row[0] for row in writer.execute(REDONE, (series, *span))}
    for hour_ns in range(span[0], span[1], HOUR_NS):
        if hour_ns in redone:
            return hour_ns
        hour = (hour_ns, hour_ns + HOUR_NS)
        minutes = minutes_of(writer, series, hour)
        if minutes is not None and not all(
            _agrees(writer, series, minutes, width, hour) for width in WIDTHS_NS
        ):
            writer.execute(REDO, (series, hour_ns))
            return hour_ns
    return span[1]


def _agrees(writer: Connection, series: int, fine: Cells, width_ns: int, span: Span) -> bool:
    wanted = fine.gathered(width_ns)
    found = select_cells(writer, series, width_ns, span, rolled_columns(writer))
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


RETENTION_TABLES = """
    CREATE TABLE retention_mark (
        series INTEGER NOT NULL REFERENCES series (id),
        width_s INTEGER NOT NULL,
        until_ns INTEGER NOT NULL,
        PRIMARY KEY (series, width_s)
    ) STRICT, WITHOUT ROWID;
"""
"""Migration that creates the table of the times up to which data were deleted.

``until_ns``, a whole hour, is the end of the deleted single readings (width 0) or roll-ups.
"""
