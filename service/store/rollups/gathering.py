"""Roll-ups behind the store's interface."""

from service.store.database import Connect
from service.store.rollups.making import MINUTE_NS
from service.store.rollups.rolling import gather_anew, gather_next

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


class SqlRollups:
    """The tables of roll-ups of one database.

    Parameters
    ----------
    writing
        Opens a transaction that is durable when left.
    reading
        Opens a connection that only reads.
    """

    def __init__(self, writing: Connect, reading: Connect) -> None:
        self._writing, self._reading = writing, reading

    def due(self, now_ns: int) -> list[int]:
        """Numbers of the bearings that have readings to gather, the one most behind first."""
        with self._reading() as reader:
            rows = reader.execute(DUE, {"now_ns": now_ns, "width_ns": MINUTE_NS})
            return [int(row[0]) for row in rows]

    def gather(self, series: int, now_ns: int) -> None:
        """Gather some readings of one bearing.

        Raises
        ------
        StoreError
            If nothing was gathered; the message is the database's.
        """
        with self._writing() as writer:
            gather_anew(writer, series)
            gather_next(writer, series, now_ns)
