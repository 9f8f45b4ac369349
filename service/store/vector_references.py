"""Reference vectors of 1×: rows are added and never changed, the newest rules."""

import json

from core.alarms.judgements import OrderVector, VectorReference
from core.condition.operating_state import OperatingState
from service.store.audit_chain import AuditChain
from service.store.audit_deeds import vector_deed
from service.store.database import Connect
from service.store.port import StoreError
from service.store.vector_reference_port import SetVectorReference

VECTOR_REFERENCE_TABLES = """
    CREATE TABLE vector_reference (
        id INTEGER PRIMARY KEY AUTOINCREMENT,
        unit TEXT NOT NULL,
        bearing TEXT NOT NULL,
        state INTEGER NOT NULL,
        set_ns INTEGER NOT NULL,
        author TEXT NOT NULL,
        note TEXT NOT NULL,
        vectors TEXT NOT NULL
    ) STRICT;
    CREATE INDEX vector_reference_of ON vector_reference (unit, bearing, id);
    CREATE TRIGGER vector_reference_kept_as_set BEFORE UPDATE ON vector_reference
    BEGIN SELECT RAISE(ABORT, 'references are kept as they were set'); END;
    CREATE TRIGGER vector_reference_kept BEFORE DELETE ON vector_reference
    BEGIN SELECT RAISE(ABORT, 'references are kept'); END;
"""
"""Statements of the migration that brings them."""

MAX_HISTORY = 1000

COLUMNS = "unit, bearing, state, set_ns, author, note, vectors"
INSERT = f"INSERT INTO vector_reference ({COLUMNS}) VALUES (?,?,?,?,?,?,?)"  # noqa: S608
IN_FORCE = (
    f"SELECT {COLUMNS} FROM vector_reference WHERE id IN"  # noqa: S608
    " (SELECT max(id) FROM vector_reference GROUP BY unit, bearing, state) ORDER BY id"
)
RULING = (
    f"SELECT {COLUMNS} FROM vector_reference"  # noqa: S608
    " WHERE unit = ? AND bearing = ? AND state = ? ORDER BY id DESC LIMIT 1"
)
SET_THEN = (
    f"SELECT {COLUMNS} FROM vector_reference"  # noqa: S608
    " WHERE unit = ? AND bearing = ? AND state = ? AND set_ns = ?"
)
HISTORY = (
    f"SELECT {COLUMNS} FROM vector_reference"  # noqa: S608
    " WHERE unit = ? AND bearing = ? ORDER BY id DESC LIMIT ?"
)

Row = tuple[str, str, int, int, str, str, str]


class SqlVectorReferences:
    """Reference vectors in the database of a store."""

    def __init__(
        self,
        writing: Connect,
        reading: Connect,
        audit: AuditChain,
    ) -> None:
        self._writing, self._reading, self._audit = writing, reading, audit

    def add(self, reference: SetVectorReference) -> None:
        """Write a reference; see :class:`service.store.vector_reference_port.VectorReferenceStore`.

        Raises
        ------
        StoreError
            If it was not written; the message is the database's.
        """
        found = reference.reference
        vectors = {p: (v.amplitude_um_pk, v.phase_deg) for p, v in found.vectors.items()}
        row = (found.unit, found.bearing, int(found.state), reference.set_ns)
        with self._writing() as writer:
            if any(_reference(each) == reference for each in writer.execute(SET_THEN, row)):
                return  # by a call whose end nobody could tell
            before = writer.execute(RULING, row[:3]).fetchone()
            deed = vector_deed(_reference(before) if before else None, reference)
            self._audit.add(writer, [deed])
            writer.execute(INSERT, (*row, reference.author, reference.note, json.dumps(vectors)))

    def in_force(self) -> list[SetVectorReference]:
        """Read the newest of every bearing and operating state."""
        with self._reading() as reader:
            return [_reference(row) for row in reader.execute(IN_FORCE)]

    def history(self, unit: str, bearing: str) -> list[SetVectorReference]:
        """Read what was ever set for a bearing, newest first."""
        with self._reading() as reader:
            rows = reader.execute(HISTORY, (unit, bearing, MAX_HISTORY))
            return [_reference(row) for row in rows]


def _reference(row: Row) -> SetVectorReference:
    unit, bearing, state, set_ns, author, note, vectors = row
    try:
        found = {place: OrderVector(*vector) for place, vector in json.loads(vectors).items()}
        reference = VectorReference(unit, bearing, OperatingState(state), found)
    except (ValueError, TypeError) as error:
        raise StoreError(f"a 1× reference of unit {unit} bearing {bearing}: {error}") from error
    return SetVectorReference(reference, set_ns, author, note)
