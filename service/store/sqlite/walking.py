"""Reading a table from end to end, some rows at a time: which are altered, and which are gone."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from service.store.database import Connection
from service.store.seals.damage import DamageLog, Place
from service.store.seals.table import SealedTable

ROWS_AT_ONCE = 2000
"""Read in one look at the database: a short one does not make its log grow."""

Key = tuple[Any, ...]
"""Of a row, the columns that it is found by."""


@dataclass(frozen=True)
class Walk:
    """A way through a table, or through its seals.

    Parameters
    ----------
    source
        Statement for keys and whether the row is as it should be.
    keys
        Columns of the key, as the statement calls them.
    is_of_seals
        Whether seals are walked through, whose rows may be gone.
    """

    table: SealedTable
    source: str
    keys: str
    is_of_seals: bool

    def page(
        self, reader: Connection, log: DamageLog, after: Key | None, n_rows: int = ROWS_AT_ONCE
    ) -> Key | None:
        """Look at the rows behind a key, in its order; the last one's key, None if none was left.

        Altered rows are noted by the function that compares seals.
        """
        marks = ", ".join("?" * len(self.table.key))
        beyond = "" if after is None else f"WHERE ({self.keys}) > ({marks})"
        statement = f"{self.source} {beyond} ORDER BY {self.keys} LIMIT {n_rows}"
        rows = reader.execute(statement, after or ()).fetchall()
        if self.is_of_seals:
            for *key, is_there in rows:
                if not is_there:
                    log.note(Place(self.table.name, _words(self.table, key), is_missing=True))
        return tuple(rows[-1][:-1]) if rows else None


def walks(table: SealedTable) -> tuple[Walk, Walk]:
    """What there is to walk through: rows, for those altered, and seals, for rows that are gone."""
    keys, of_seals = _keys(table, "r."), _keys(table, "s.")
    row = f"SELECT 1 FROM main.{table.name} AS r WHERE {table.matched('s.', 'r.')}"  # noqa: S608
    rows = f"SELECT {keys}, {table.is_whole('r.')} FROM main.{table.name} AS r"  # noqa: S608
    seals = f"SELECT {of_seals}, EXISTS ({row}) FROM main.{table.seals} AS s"  # noqa: S608
    return (
        Walk(table, rows, keys, is_of_seals=False),
        Walk(table, seals, of_seals, is_of_seals=True),
    )


def _keys(table: SealedTable, of: str) -> str:
    return ", ".join(of + column for column in table.key)


def _words(table: SealedTable, key: Sequence[object]) -> str:
    words = ", ".join(f"{column} {cell}" for column, cell in zip(table.key, key, strict=True))
    return words.encode("utf-8", "replace").decode("utf-8")  # a damaged text may be none
