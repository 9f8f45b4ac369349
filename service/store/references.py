"""Tables of gap references and 1× vector references; the newest reference is in force."""

import json
from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any, Generic, TypeVar

from core.alarms.judgements import OrderVector, VectorReference
from core.condition.operating_state import OperatingState
from service.store.access.audit_entries import AuditAction, acting
from service.store.audit import AuditedTables
from service.store.database import insert
from service.store.port import StoreError

MAX_GAP_UM = 10_000.0
MAX_AUTHOR = 80
MAX_NOTE = 500

MAX_HISTORY = 1000
"""Maximum number of references of one bearing that `history` returns."""

MicrometrePair = tuple[float, float]


class ReferenceSource(StrEnum):
    """Origin of the gap values of a reference: entered by a person, or measured."""

    GIVEN = "given"
    MEASURED = "measured"


@dataclass(frozen=True)
class GapReference:
    """Probe gaps of a bearing with the shaft centred; stored references are never changed.

    Parameters
    ----------
    set_ns
        Time at which the reference was set, ns since 1970 UTC.
    author
        Person who set the reference, 1 to 80 printable characters.
    gap_reference_um
        Probe gaps (x, y), above 0 up to 10 000 µm.
    opposite_reference_um
        Gaps (x, y) of the opposite probes; None if the bearing has no opposite probes.
    note
        Note of the author, at most 500 printable characters; may be empty.

    Raises
    ------
    ValueError
        If a value is outside its limits; the message states the value and the limit.
    """

    unit: str
    bearing: str
    set_ns: int
    author: str
    gap_reference_um: MicrometrePair
    opposite_reference_um: MicrometrePair | None
    source: ReferenceSource
    note: str = ""

    def __post_init__(self) -> None:
        _check_pair("gap", self.gap_reference_um)
        if self.opposite_reference_um is not None:
            _check_pair("opposite gap", self.opposite_reference_um)
        if not self.author.strip():
            raise ValueError("author is empty; give the name of the person who sets the reference")
        _check_text("author", self.author, MAX_AUTHOR)
        _check_text("note", self.note, MAX_NOTE)


def _check_pair(what: str, pair: MicrometrePair) -> None:
    for axis, gap_um in zip("xy", pair, strict=True):
        if not 0.0 < gap_um <= MAX_GAP_UM:  # also refuses NaN
            raise ValueError(
                f"{what} {axis} is {gap_um:g} µm; it must be above 0 and at most {MAX_GAP_UM:g} µm"
            )


def _check_text(what: str, text: str, n_most: int) -> None:
    if len(text) > n_most:
        raise ValueError(f"{what} has {len(text)} characters; it must have at most {n_most}")
    if not text.isprintable():
        raise ValueError(f"{what} has a line break or another unprintable character; remove it")


@dataclass(frozen=True)
class SetVectorReference:
    """1× vector reference with its author and time; stored references are never changed.

    Parameters
    ----------
    set_ns
        Time at which the reference was set, ns since 1970 UTC.
    """

    reference: VectorReference
    set_ns: int
    author: str
    note: str = ""


_Reference = TypeVar("_Reference", GapReference, SetVectorReference)


class _References(AuditedTables, ABC, Generic[_Reference]):
    action: str
    """Action in the audit trail."""

    table: str
    columns: tuple[str, ...]
    key: tuple[str, ...]
    """Key columns, with which `columns` begins; one reference is in force per key."""

    order: str
    """Columns by which `in_force` sorts the references, as an SQL expression."""

    def add(self, reference: _Reference) -> None:
        """Write a reference and put it in force; a reference that is stored already is ignored.

        Raises `StoreError` if the reference was not written, or the outcome is unknown.
        """
        row = self._row(reference)
        key = " AND ".join(f"{name} = ?" for name in self.key)
        statement = f"{self._select} WHERE {key} ORDER BY id DESC"
        with self._writing() as writer:
            rows = writer.execute(statement, row[: len(self.key)])
            before = [self._load(each) for each in rows]
            if reference not in before:
                action = self._action(before[0] if before else None, reference)
                self._audit.add(writer, [action])
                writer.execute(insert(self.table, self.columns), row)

    def in_force(self) -> list[_Reference]:
        """Return the references in force: the last written per bearing, and operating state if any.

        The time `set_ns` at which a reference was set has no influence.
        """
        newest = f"SELECT max(id) FROM {self.table} GROUP BY {', '.join(self.key)}"  # noqa: S608
        return self._read(f"WHERE id IN ({newest}) ORDER BY {self.order}")

    def history(self, unit: str, bearing: str) -> list[_Reference]:
        """Return the newest references of a bearing, newest first; at most `MAX_HISTORY`."""
        where = "WHERE unit = ? AND bearing = ? ORDER BY id DESC LIMIT ?"
        return self._read(where, unit, bearing, MAX_HISTORY)

    @property
    def _select(self) -> str:
        return f"SELECT {', '.join(self.columns)} FROM {self.table}"  # noqa: S608

    def _read(self, where: str, *parameters: object) -> list[_Reference]:
        with self._reading() as reader:
            rows = reader.execute(f"{self._select} {where}", parameters)
            return [self._load(row) for row in rows]

    def _action(self, before: _Reference | None, reference: _Reference) -> AuditAction:
        return AuditAction(
            time_ns=reference.set_ns,
            actor=reference.author,
            action=self.action,
            object=self._object(reference),
            before=None if before is None else self._values(before),
            after=self._values(reference),
            reason=reference.note,
            source=acting().source,
            peer=acting().peer,
        )

    @abstractmethod
    def _row(self, reference: _Reference) -> tuple[object, ...]:
        """Return the values of `columns`."""

    @abstractmethod
    def _load(self, row: tuple[Any, ...]) -> _Reference:
        """Return the reference of a row. Raises `StoreError` if the row is damaged."""

    @abstractmethod
    def _object(self, reference: _Reference) -> str:
        """Return the object of the audit entry."""

    @abstractmethod
    def _values(self, reference: _Reference) -> dict[str, object]:
        """Return the values of the audit entry."""


class GapReferenceStore(_References[GapReference]):
    """Table of the gap references of all bearings; the newest is in force for its bearing."""

    action = "gap_reference.set"
    table = "gap_reference"
    columns = (
        *("unit", "bearing", "set_ns", "author", "x_um", "y_um"),
        *("opposite_x_um", "opposite_y_um", "source", "note"),
    )
    key = ("unit", "bearing")
    order = "unit, bearing"

    def _row(self, reference: GapReference) -> tuple[object, ...]:
        return (
            *(reference.unit, reference.bearing, reference.set_ns, reference.author),
            *reference.gap_reference_um,
            *(reference.opposite_reference_um or (None, None)),
            *(reference.source.value, reference.note),
        )

    def _load(self, row: tuple[Any, ...]) -> GapReference:
        unit, bearing, set_ns, author, x_um, y_um, *opposite, source, note = row
        gaps = ((x_um, y_um), None if opposite[0] is None else (opposite[0], opposite[1]))
        try:
            return GapReference(unit, bearing, set_ns, author, *gaps, ReferenceSource(source), note)
        except ValueError as error:
            name = f"stored gap reference of unit {unit} bearing {bearing}"
            raise StoreError(f"{name} is invalid ({error}); restore a backup") from error

    def _object(self, reference: GapReference) -> str:
        return f"{reference.unit}:{reference.bearing}"

    def _values(self, reference: GapReference) -> dict[str, object]:
        names = ("author", "set_ns", "gap_reference_um", "opposite_reference_um", "source")
        return {name: getattr(reference, name) for name in names}


class VectorReferenceStore(_References[SetVectorReference]):
    """Table of the 1× vector references; one per bearing and operating state is in force."""

    action = "order1_reference.set"
    table = "vector_reference"
    columns = ("unit", "bearing", "state", "set_ns", "author", "note", "vectors")
    key = ("unit", "bearing", "state")
    order = "id"

    def _row(self, reference: SetVectorReference) -> tuple[object, ...]:
        its = reference.reference
        vectors = {p: (v.amplitude_um_pk, v.phase_deg) for p, v in its.vectors.items()}
        key = (its.unit, its.bearing, int(its.state))
        return (*key, reference.set_ns, reference.author, reference.note, json.dumps(vectors))

    def _load(self, row: tuple[Any, ...]) -> SetVectorReference:
        unit, bearing, state, set_ns, author, note, vectors = row
        try:
            found = {place: OrderVector(*vector) for place, vector in json.loads(vectors).items()}
            reference = VectorReference(unit, bearing, OperatingState(state), found)
        except (ValueError, TypeError) as error:
            name = f"stored 1× reference of unit {unit} bearing {bearing}"
            raise StoreError(f"{name} is invalid ({error}); restore a backup") from error
        return SetVectorReference(reference, set_ns, author, note)

    def _object(self, reference: SetVectorReference) -> str:
        its = reference.reference
        return f"{its.unit}:{its.bearing}:{its.state.name.lower()}"

    def _values(self, reference: SetVectorReference) -> dict[str, object]:
        vectors = {place: asdict(vector) for place, vector in reference.reference.vectors.items()}
        return {"author": reference.author, "set_ns": reference.set_ns, "vectors": vectors}


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
"""Migration that creates the table of 1× vector references."""
