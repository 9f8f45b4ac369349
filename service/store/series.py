"""Numbers of series: a unit's bearing is a number in every other table."""

from service.store.database import Connection

FIND = "SELECT id FROM series WHERE unit = ? AND bearing = ?"
ADD = "INSERT INTO series (unit, bearing) VALUES (?, ?) ON CONFLICT DO NOTHING"


def series_of(writer: Connection, unit: str, bearing: str) -> int:
    """Number of a unit's bearing, given one within a transaction if it has none."""
    found = writer.execute(FIND, (unit, bearing)).fetchone()
    if found is None:
        writer.execute(ADD, (unit, bearing))
        found = writer.execute(FIND, (unit, bearing)).fetchone()
    return int(found[0])
