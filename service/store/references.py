"""References: rows are added and never changed, the newest of a bearing rules."""

from service.store.database import Connection
from service.store.gap_reference import GapReference, MicrometrePair, ReferenceSource
from service.store.port import StoreError

MAX_HISTORY = 1000
"""Most references of one bearing that are handed out at once."""

COLUMNS = "unit, bearing, set_ns, author, x_um, y_um, opposite_x_um, opposite_y_um, source, note"
INSERT = f"INSERT INTO gap_reference ({COLUMNS}) VALUES (?,?,?,?,?,?,?,?,?,?)"  # noqa: S608
IN_FORCE = (
    f"SELECT {COLUMNS} FROM gap_reference"  # noqa: S608
    " WHERE id IN (SELECT max(id) FROM gap_reference GROUP BY unit, bearing) ORDER BY unit, bearing"
)
"""By order of setting, not by time: a clock that was put back makes no reference older."""
HISTORY = (
    f"SELECT {COLUMNS} FROM gap_reference"  # noqa: S608
    " WHERE unit = ? AND bearing = ? ORDER BY id DESC LIMIT ?"
)
SET_THEN = f"SELECT {COLUMNS} FROM gap_reference WHERE unit = ? AND bearing = ? AND set_ns = ?"  # noqa: S608

Row = tuple[str, str, int, str, float, float, float | None, float | None, str, str]


def insert_reference(writer: Connection, reference: GapReference) -> None:
    """Add a reference to its bearing's history."""
    opposite = reference.opposite_reference_um or (None, None)
    writer.execute(
        INSERT,
        (
            reference.unit,
            reference.bearing,
            reference.set_ns,
            reference.author,
            *reference.gap_reference_um,
            *opposite,
            reference.source.value,
            reference.note,
        ),
    )


def is_set(reader: Connection, reference: GapReference) -> bool:
    """Whether it is written already: by a call whose end nobody could tell."""
    where = (reference.unit, reference.bearing, reference.set_ns)
    return any(_reference(row) == reference for row in reader.execute(SET_THEN, where))


def select_in_force(reader: Connection) -> list[GapReference]:
    """The newest reference of every bearing that has one."""
    return [_reference(row) for row in reader.execute(IN_FORCE)]


def select_history(reader: Connection, unit: str, bearing: str) -> list[GapReference]:
    """The references of one bearing, newest first."""
    return [_reference(row) for row in reader.execute(HISTORY, (unit, bearing, MAX_HISTORY))]


def _reference(row: Row) -> GapReference:
    unit, bearing, set_ns, author, x_um, y_um, far_x_um, far_y_um, source, note = row
    opposite: MicrometrePair | None = None
    if far_x_um is not None and far_y_um is not None:
        opposite = (far_x_um, far_y_um)
    try:
        return GapReference(
            unit, bearing, set_ns, author, (x_um, y_um), opposite, ReferenceSource(source), note
        )
    except ValueError as error:
        raise StoreError(f"a reference of unit {unit} bearing {bearing}: {error}") from error
