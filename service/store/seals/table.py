"""`SealedTable`: the SQL by which rows of one table are sealed, and read only with their seal."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

SEAL, IS_WHOLE = "padwatch_seal_", "padwatch_is_whole_"
"""Functions that the connections of padwatch know; each table has its own, for speed."""

WHOLE = "whole_"
"""Views that show only rows that are whole also to a connection that writes."""


@dataclass(frozen=True)
class SealedTable:
    """A table whose rows have seals.

    Parameters
    ----------
    types
        Of its columns, in their order.
    key
        Columns by which a row is found.
    """

    name: str
    types: Mapping[str, str]
    key: Sequence[str]

    @property
    def columns(self) -> Sequence[str]:
        """Names of its columns, in their order."""
        return list(self.types)

    @property
    def seals(self) -> str:
        """Name of the table with its seals."""
        return f"seal_{self.name}"

    @cached_property
    def create(self) -> Sequence[str]:
        """Make the table of seals, and seal what there is already."""
        keys = ", ".join(self.key)
        # of the same types, or no seal would be found without reading all of them
        typed = ", ".join(f"{column} {self.types[column]} NOT NULL" for column in self.key)
        return (
            f"CREATE TABLE {self.seals} ({typed}, seal INTEGER NOT NULL, PRIMARY KEY ({keys}))"
            " STRICT, WITHOUT ROWID",
            f"INSERT INTO {self.seals} SELECT {keys}, {self._seal('')} FROM {self.name}",  # noqa: S608
        )

    @cached_property
    def triggers(self) -> Sequence[str]:
        """Seal what is written from now on, over this connection."""
        keys = ", ".join(self.key)
        put = (
            f"INSERT INTO {self.seals} VALUES ({self._listed('NEW.')}, {self._seal('NEW.')})"  # noqa: S608
            f" ON CONFLICT ({keys}) DO UPDATE SET seal = excluded.seal;"
        )
        forget = f"DELETE FROM {self.seals} WHERE {self.matched('OLD.')};"  # noqa: S608
        bodies = {"INSERT": put, "UPDATE": forget + put, "DELETE": forget}
        return [
            f"CREATE TEMP TRIGGER sealed_{self.name}_{deed.lower()} AFTER {deed} ON"
            f" main.{self.name} BEGIN {body} END"
            for deed, body in bodies.items()
        ]

    def view(self, before: str = "") -> str:
        """Let this connection see only rows that are whole, by the table's name or another one."""
        listed = ", ".join(f"r.{column} AS {column}" for column in self.columns)
        return (
            f"CREATE TEMP VIEW {before}{self.name} AS SELECT {listed}"  # noqa: S608
            f" FROM main.{self.name} AS r WHERE {self.is_whole('r.')}"
        )

    def is_whole(self, of: str) -> str:
        """Whether a row fits its seal, as an expression."""
        seal = f"SELECT s.seal FROM main.{self.seals} AS s WHERE {self.matched(of, 's.')}"  # noqa: S608
        return f"{IS_WHOLE}{self.name}(({seal}), {self._cells(of)})"

    def matched(self, of: str, ours: str = "") -> str:
        """Whether a row has the key of a seal, as an expression."""
        return " AND ".join(f"{ours}{column} = {of}{column}" for column in self.key)

    def _seal(self, of: str) -> str:
        return f"{SEAL}{self.name}({self._cells(of)})"

    def _listed(self, of: str) -> str:
        return ", ".join(of + column for column in self.key)

    def _cells(self, of: str) -> str:
        return ", ".join(
            f"CAST({of}{column} AS BLOB)" if type_ == "TEXT" else of + column
            for column, type_ in self.types.items()
        )
