"""Keys and encoding of stored series."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.monitor.catalogue import Quantity
from core.quality import Quality, Reading, Reason
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


LEVEL_SHIFT = 6
"""A quality byte is the level in its two top bits and the number of the reason below."""


U_RANDOM, U_SYSTEMATIC = ".u_random", ".u_systematic"
"""Behind the name of a quantity: the column of its standard uncertainty."""


def columns_of(quantities: Iterable[Quantity]) -> tuple[str, ...]:
    """Names of the columns that hold quantities and, where they are kept, their uncertainties."""
    suffixes = {False: ("",), True: ("", U_RANDOM, U_SYSTEMATIC)}
    return tuple(q.name + suffix for q in quantities for suffix in suffixes[q.keeps_uncertainty])


@dataclass(frozen=True)
class Layout:
    """Which columns a stored row holds, and what its reason numbers mean.

    Rows keep the layout they were written with, so that the catalogue can grow.
    """

    quantities: tuple[str, ...]
    reasons: tuple[str, ...]

    @classmethod
    def of(cls, quantities: tuple[str, ...]) -> "Layout":
        """Layout that this version of padwatch writes."""
        return cls(quantities, tuple(reason.value for reason in Reason))

    def dumps(self) -> tuple[str, str]:
        """Quantities and reasons as JSON, as they stand in the database."""
        return json.dumps(self.quantities), json.dumps(self.reasons)

    @staticmethod
    @lru_cache(maxsize=64)
    def loads(quantities: str, reasons: str) -> "Layout":
        """Invert `dumps`; every query reads the same few again."""
        return Layout(tuple(json.loads(quantities)), tuple(json.loads(reasons)))

    def encode(self, readings: Mapping[str, Reading]) -> tuple[bytes, bytes]:
        """Values (NaN for none) and qualities, in the order of the layout."""
        ordered = [_column(readings, name) for name in self.quantities]
        values = np.array([number for number, _ in ordered], dtype="<f8")
        qualities = bytes(
            quality.level << LEVEL_SHIFT | self.reasons.index(quality.reason.value)
            for _, quality in ordered
        )
        return values.tobytes(), qualities

    def decode(
        self, values: list[bytes], qualities: list[bytes]
    ) -> tuple[FloatArray, npt.NDArray[np.uint8]]:
        """Values, NaN for none, and quality levels: (n_rows, n_quantities) both."""
        shape = (len(values), len(self.quantities))
        number = np.frombuffer(b"".join(values), dtype="<f8").reshape(shape)
        byte = np.frombuffer(b"".join(qualities), dtype=np.uint8).reshape(shape)
        return number.astype(np.float64), (byte >> LEVEL_SHIFT).astype(np.uint8)


def _column(readings: Mapping[str, Reading], column: str) -> tuple[float, Quality]:
    name, dot, which = column.partition(".")
    reading = readings[name]
    number = {U_RANDOM: reading.u_random, U_SYSTEMATIC: reading.u_systematic}.get(
        dot + which, reading.value
    )
    return np.nan if number is None else number, reading.quality


def remember_layout(writer: Connection, layout: Layout) -> int:
    """Number of a layout, given one within a transaction if it has none."""
    key = layout.dumps()
    writer.execute(
        "INSERT INTO layout (quantities, reasons) VALUES (?, ?) ON CONFLICT DO NOTHING", key
    )
    found = writer.execute("SELECT id FROM layout WHERE quantities = ? AND reasons = ?", key)
    return int(found.fetchone()[0])
