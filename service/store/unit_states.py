"""Reports on units in the database: a row for each unit, overwritten about every second."""

from collections.abc import Collection, Sequence

from service.store.database import Connect, Connection
from service.store.unit_states_port import UnitBeat, UnitReport

UNIT_STATUS_TABLES = """
    CREATE TABLE unit_status (
        unit TEXT PRIMARY KEY,
        process TEXT NOT NULL,
        n_beats INTEGER NOT NULL,
        beat_ns INTEGER NOT NULL,
        link TEXT NOT NULL,
        reason TEXT,
        last_sample_ns INTEGER,
        signs TEXT NOT NULL,
        revision INTEGER NOT NULL,
        state BLOB NOT NULL
    ) STRICT;
"""

COLUMNS = "process, n_beats, beat_ns, link, reason, last_sample_ns, signs, revision"
BEAT = """
    UPDATE unit_status SET n_beats = ?, beat_ns = ?, link = ?, reason = ?, last_sample_ns = ?,
    signs = ? WHERE unit = ? AND process = ? AND revision = ?
"""
"""Leaves the state alone, which is large."""

WHOLE = f"""
    INSERT INTO unit_status (unit, {COLUMNS}, state) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)
    ON CONFLICT (unit) DO UPDATE SET process = excluded.process, n_beats = excluded.n_beats,
    beat_ns = excluded.beat_ns, link = excluded.link, reason = excluded.reason,
    last_sample_ns = excluded.last_sample_ns, signs = excluded.signs,
    revision = excluded.revision, state = excluded.state
"""  # noqa: S608
SELECT_BEATS = (
    "SELECT unit, process, n_beats, beat_ns, signs, revision FROM unit_status ORDER BY unit"
)
SELECT_STATE = "SELECT process, revision, state FROM unit_status WHERE unit = ?"


class StoredUnitStates:
    """The newest report on each unit, in the database of a store.

    Parameters
    ----------
    write, read
        A transaction, and a short look; both raise `StoreError`.
    """

    def __init__(self, write: Connect, read: Connect) -> None:
        self._write, self._read = write, read

    def report(self, process: str, reports: Sequence[UnitReport]) -> None:
        """Write what a process says of its units, in one transaction."""
        with self._write() as writer:
            # in one order everywhere, so that two writers never wait for each other
            for report in sorted(reports, key=lambda report: report.unit):
                _write(writer, process, report)

    def beats(self) -> list[UnitBeat]:
        """Read the newest report on each unit, without the states."""
        with self._read() as reader:
            return [UnitBeat(*row) for row in reader.execute(SELECT_BEATS)]

    def states(self, units: Collection[str]) -> dict[str, tuple[str, int, bytes]]:
        """Read states of units."""
        with self._read() as reader:
            found = {unit: reader.execute(SELECT_STATE, (unit,)).fetchone() for unit in units}
        return {
            unit: (str(row[0]), int(row[1]), bytes(row[2]))
            for unit, row in found.items()
            if row is not None
        }


def _write(writer: Connection, process: str, report: UnitReport) -> None:
    beat = (report.n_beats, report.beat_ns, report.link, report.reason, report.last_sample_ns)
    if report.state is None:
        where = (report.signs, report.unit, process, report.revision)
        writer.execute(BEAT, (*beat, *where))
    else:
        content = (report.signs, report.revision, report.state)
        writer.execute(WHOLE, (report.unit, process, *beat, *content))
