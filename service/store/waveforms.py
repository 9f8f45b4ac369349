"""Index of waveform recordings in the database."""

from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from enum import StrEnum
from typing import Any

from service.store.database import Tables, upsert
from service.store.port import StoreError


class WaveformKind(StrEnum):
    """Kind of a waveform recording: capture around an alarm, or continuous recording."""

    CAPTURE = "capture"
    CONTINUOUS = "continuous"


class WaveformState(StrEnum):
    """State of a waveform recording on the disk."""

    PRESENT = "present"
    DAMAGED = "damaged"
    MISSING = "missing"
    REMOVED = "removed"


@dataclass(frozen=True)
class WaveformFile:
    """Index entry of a waveform recording; times are in ns since 1970 UTC.

    Parameters
    ----------
    place
        Identifier of the data folder, since several data folders may share a database.
    name
        Name of the recording's folder within the folder of its kind.
    start_ns
        Time of the first sample.
    stop_ns
        Time one sampling interval after the last sample.
    n_samples
        Number of samples per channel.
    n_bytes
        Total size of the files.
    checksum
        SHA-256 of the manifest, which lists the checksums of the other files; empty if unreadable.
    reason
        Reason for the state; may be empty.
    changed_ns, checked_ns
        Times of the last change of state, and of the last complete check.
    """

    place: str
    kind: WaveformKind
    name: str
    unit: str
    start_ns: int
    stop_ns: int
    n_samples: int
    n_bytes: int
    checksum: str
    state: WaveformState = WaveformState.PRESENT
    reason: str = ""
    changed_ns: int = 0
    checked_ns: int = 0


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
"""Migration that creates the table of recordings."""

COLUMNS = [field.name for field in fields(WaveformFile)]
PUT = upsert("waveform", COLUMNS, ("place", "kind", "name"))
FILES = (
    f"SELECT {', '.join(COLUMNS)} FROM waveform WHERE place = ? AND state <> 'removed'"  # noqa: S608
    " ORDER BY start_ns, kind, name"
)
FORGET = (
    "DELETE FROM waveform WHERE place = ? AND state IN ('removed', 'missing') AND changed_ns < ?"
)


class WaveformStore(Tables):
    """Store of the index of recordings in all data folders; the database holds no waveforms."""

    def put(self, files: Sequence[WaveformFile]) -> None:
        """Write index entries in one transaction; replace entries of equal place, kind and name.

        Raises `StoreError` if nothing was written.
        """
        with self._writing() as writer:
            writer.executemany(PUT, [astuple(file) for file in files])

    def files(self, place: str) -> list[WaveformFile]:
        """Return the entries of a data folder without those of removed recordings, oldest first."""
        with self._reading() as reader:
            return [_file(row) for row in reader.execute(FILES, (place,))]

    def forget(self, place: str, before_ns: int) -> int:
        """Delete entries of recordings removed or lost before a time, ns; return their number."""
        with self._writing() as writer:
            return writer.execute(FORGET, (place, before_ns)).rowcount


def _file(row: tuple[Any, ...]) -> WaveformFile:
    found = dict(zip(COLUMNS, row, strict=True))
    try:
        found |= {"kind": WaveformKind(found["kind"]), "state": WaveformState(found["state"])}
    except ValueError as error:
        name = f"index entry of recording {found['name']}"
        raise StoreError(f"{name} is invalid ({error}); restore a backup") from error
    return WaveformFile(**found)
