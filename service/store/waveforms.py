"""The index of waveform files in the database of a store."""

from collections.abc import Sequence

from service.store.database import Connect
from service.store.port import StoreError
from service.store.waveform_port import WaveformFile, WaveformKind, WaveformState

WAVEFORM_TABLES = """
    CREATE TABLE waveform (
        place TEXT NOT NULL,
        kind TEXT NOT NULL CHECK (kind IN ('capture', 'continuous')),
        name TEXT NOT NULL,
        unit TEXT NOT NULL,
        start_ns INTEGER NOT NULL,
        stop_ns INTEGER NOT NULL,
        n_samples INTEGER NOT NULL CHECK (n_samples >= 0),
        n_bytes INTEGER NOT NULL CHECK (n_bytes >= 0),
        checksum TEXT NOT NULL,
        state TEXT NOT NULL CHECK (state IN ('present', 'damaged', 'missing', 'removed')),
        reason TEXT NOT NULL,
        changed_ns INTEGER NOT NULL,
        checked_ns INTEGER NOT NULL,
        PRIMARY KEY (place, kind, name)
    ) STRICT;
    CREATE INDEX waveform_of_state ON waveform (place, state, start_ns);
"""
"""Statements of the migration that brings them."""

COLUMNS = (
    "place, kind, name, unit, start_ns, stop_ns, n_samples, n_bytes, checksum, state, reason,"
    " changed_ns, checked_ns"
)
PUT = f"""
    INSERT INTO waveform ({COLUMNS}) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)
    ON CONFLICT (place, kind, name) DO UPDATE SET unit = excluded.unit,
    start_ns = excluded.start_ns, stop_ns = excluded.stop_ns, n_samples = excluded.n_samples,
    n_bytes = excluded.n_bytes, checksum = excluded.checksum, state = excluded.state,
    reason = excluded.reason, changed_ns = excluded.changed_ns, checked_ns = excluded.checked_ns
"""  # noqa: S608
FILES = (
    f"SELECT {COLUMNS} FROM waveform WHERE place = ? AND state <> 'removed'"  # noqa: S608
    " ORDER BY start_ns, kind, name"
)
FORGET = (
    "DELETE FROM waveform WHERE place = ? AND state IN ('removed', 'missing') AND changed_ns < ?"
)

Row = tuple[str, str, str, str, int, int, int, int, str, str, str, int, int]


class StoredWaveforms:
    """Entries of all places; see :class:`service.store.waveform_port.WaveformStore`.

    Parameters
    ----------
    write, read
        A transaction, and a short look; both raise `StoreError`.
    """

    def __init__(self, write: Connect, read: Connect) -> None:
        self._write, self._read = write, read

    def put(self, files: Sequence[WaveformFile]) -> None:
        """Write entries in one transaction.

        Raises
        ------
        StoreError
            If nothing was written.
        """
        with self._write() as writer:
            writer.executemany(PUT, [_row(file) for file in files])

    def files(self, place: str) -> list[WaveformFile]:
        """Read what there is or should be in a place."""
        with self._read() as reader:
            return [_file(row) for row in reader.execute(FILES, (place,))]

    def forget(self, place: str, before_ns: int) -> int:
        """Drop entries of what has long been gone.

        Raises
        ------
        StoreError
            If nothing was dropped.
        """
        with self._write() as writer:
            return writer.execute(FORGET, (place, before_ns)).rowcount


def _row(file: WaveformFile) -> Row:
    span = (file.start_ns, file.stop_ns, file.n_samples, file.n_bytes)
    now = (file.state.value, file.reason, file.changed_ns, file.checked_ns)
    return (file.place, file.kind.value, file.name, file.unit, *span, file.checksum, *now)


def _file(row: Row) -> WaveformFile:
    place, kind, name, unit, *span, checksum, state, reason, changed_ns, checked_ns = row
    try:
        found = WaveformKind(kind), WaveformState(str(state))
    except ValueError as error:
        raise StoreError(f"the entry of recording {name!r}: {error}") from error
    start_ns, stop_ns, n_samples, n_bytes = (int(n) for n in span)
    return WaveformFile(
        place,
        found[0],
        name,
        unit,
        start_ns,
        stop_ns,
        n_samples,
        n_bytes,
        str(checksum),
        found[1],
        str(reason),
        int(changed_ns),
        int(checked_ns),
    )
