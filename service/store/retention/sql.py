"""Retention behind the store's interface."""

from collections.abc import Callable

from service.store.database import Connect, Connection
from service.store.retention.deleting import Piece, delete_readings, delete_rollups
from service.store.retention.limits import RetentionLimits
from service.store.rollups.rows import HOUR_NS, NS_PER_S

MAX_FILM_READINGS = 5000
MAX_LETTERS = 500

OLD_FILM_READINGS = """
    SELECT estimator, time_ns FROM film_reading WHERE series = ? AND time_ns < ? LIMIT ?
"""
DELETE_FILM_READING = "DELETE FROM film_reading WHERE series = ? AND estimator = ? AND time_ns = ?"
OLD_LETTERS = """
    SELECT id FROM outbox AS old WHERE state <> 'waiting' AND done_ns < ? AND EXISTS (
        SELECT 1 FROM outbox AS newer WHERE newer.receiver = old.receiver
        AND newer.alarm = old.alarm AND newer.state = old.state AND newer.id > old.id
    ) AND NOT EXISTS (
        SELECT 1 FROM alarm_event WHERE alarm_event.alarm = old.alarm
        AND alarm_event.number = old.number AND alarm_event.time_ns >= ?
    ) ORDER BY id LIMIT ?
"""
"""The last one of each alarm stays: whether it is to be told that it has returned depends on it.
What happened lately stays, too: a host that began in 1970 has sent it long ago by its clock."""

BELIEVED = """
    SELECT max(start_ns) FROM (SELECT (
        SELECT start_ns FROM rollup_cell
        WHERE rollup_cell.series = series.id AND width_s = ?
        GROUP BY start_ns ORDER BY start_ns DESC LIMIT 1 OFFSET ?
    ) AS start_ns FROM series) AS believed
"""
BELIEVED_HOURS = (HOUR_NS // NS_PER_S, 23)
"""The 24th newest whole hour with results of any bearing: each is found at the end of an index.
Not by DISTINCT: where there are fewer hours SQLite 3.40 has the oldest in place of none then."""

DELETE_LETTER = "DELETE FROM outbox WHERE id = ?"


def nothing_to_give() -> bool:
    """Say so for a database that sees to its room itself."""
    return False


class SqlRetention:
    """Deletes what is old in one database.

    Parameters
    ----------
    writing
        Opens a transaction that is durable when left.
    reading
        Opens a connection that only reads.
    give_back
        Gives some free room back to the disk; whether there is more.
    """

    def __init__(
        self, writing: Connect, reading: Connect, give_back: Callable[[], bool] = nothing_to_give
    ) -> None:
        self._writing, self._reading, self._give_back = writing, reading, give_back
        self._held_up: set[tuple[int, int]] = set()

    @property
    def trouble(self) -> str | None:
        """Why some of what is old cannot be deleted; None as far as all can."""
        if not self._held_up:
            return None
        series, width_s = min(self._held_up)
        words = "are damaged, or not what wider ones say: they stay, and later ones, too"
        return f"roll-ups of {width_s} s of bearing {series} {words} ({len(self._held_up)} such)"

    def series(self) -> list[int]:
        """Numbers of all bearings."""
        with self._reading() as reader:
            return [int(row[0]) for row in reader.execute("SELECT id FROM series ORDER BY id")]

    def believed_ns(self) -> int | None:
        """The newest time that a day of results lies behind; None if there are not so many."""
        with self._reading() as reader:
            found: int | None = reader.execute(BELIEVED, BELIEVED_HOURS).fetchone()[0]
        return found

    def delete(self, series: int, limits: RetentionLimits, now_ns: int) -> bool:
        """Delete some of a bearing; whether there was anything to delete.

        Raises
        ------
        StoreError
            If nothing was deleted; the message is the database's.
        """
        found = False
        for width_s, age_ns in limits.tiers:
            if age_ns is not None:
                with self._writing() as writer:
                    piece = _delete_tier(writer, series, width_s, now_ns - age_ns)
                found |= piece is Piece.DONE
                self._held_up.discard((series, width_s))
                if piece is Piece.HELD_UP:
                    self._held_up.add((series, width_s))
        if limits.films_ns is not None:
            with self._writing() as writer:
                found |= _delete_films(writer, series, now_ns - limits.films_ns)
        return found

    def prune(self, limits: RetentionLimits, now_ns: int) -> bool:
        """Delete some of what was told to receivers; whether there was anything to delete."""
        if limits.letters_ns is None:
            return False
        with self._writing() as writer:
            before_ns = now_ns - limits.letters_ns
            old = writer.execute(OLD_LETTERS, (before_ns, before_ns, MAX_LETTERS)).fetchall()
            writer.executemany(DELETE_LETTER, old)
        return len(old) == MAX_LETTERS

    def give_back(self) -> bool:
        """Give some room that became free back to the disk; whether there is more of it."""
        return self._give_back()


def _delete_tier(writer: Connection, series: int, width_s: int, before_ns: int) -> Piece:
    if width_s == 0:
        return delete_readings(writer, series, before_ns)
    return delete_rollups(writer, series, width_s * NS_PER_S, before_ns)


def _delete_films(writer: Connection, series: int, before_ns: int) -> bool:
    old = writer.execute(OLD_FILM_READINGS, (series, before_ns, MAX_FILM_READINGS)).fetchall()
    writer.executemany(DELETE_FILM_READING, [(series, *row) for row in old])
    return bool(old)
