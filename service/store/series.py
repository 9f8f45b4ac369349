"""Result series, one per bearing: id in the database, unique times, and encoding of readings."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import groupby
from operator import itemgetter

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.monitor.catalogue import BY_NAME, CATALOGUE, Quantity, quantity_named
from core.quality import Level, Quality, Reading, Reason
from service.store.database import Connection

FIND = "SELECT id FROM series WHERE unit = ? AND bearing = ?"
ADD = "INSERT INTO series (unit, bearing) VALUES (?, ?) ON CONFLICT DO NOTHING"


def find_series(reader: Connection, unit: str, bearing: str) -> int | None:
    """Return the series id of a bearing; None if nothing is stored for it."""
    found = reader.execute(FIND, (unit, bearing)).fetchone()
    return None if found is None else int(found[0])


def series_of(writer: Connection, unit: str, bearing: str) -> int:
    """Return the series id of a bearing; insert the bearing if it has none."""
    found = find_series(writer, unit, bearing)
    if found is None:
        writer.execute(ADD, (unit, bearing))
        (found,) = writer.execute(FIND, (unit, bearing)).fetchone()
    return int(found)


def unique_time_ns(
    writer: Connection,
    select: str,
    key: tuple[object, ...],
    time_ns: int,
    measured: tuple[object, ...],
) -> int:
    """Return the earliest time, in ns, from `time_ns` on, at which no other measurement is stored.

    A device whose clock restarts or is set back reports the same times again for different
    measurements. A measurement that is already stored keeps its time.

    Parameters
    ----------
    select
        Query of the columns that `measured` is compared with; its parameters are the elements of
        `key` and the time.
    key
        Key of the series.
    measured
        Values of these columns for the new measurement, in the same order.
    """
    while writer.execute(select, (*key, time_ns)).fetchone() not in (None, measured):
        time_ns += 1
    return time_ns


LEVEL_SHIFT = 6
"""Bit offset of the level in a quality byte; the lower six bits are the number of the reason."""


U_RANDOM, U_SYSTEMATIC = ".u_random", ".u_systematic"
"""Suffixes of the columns with the standard uncertainties of a quantity."""


def columns_of(quantities: Iterable[Quantity]) -> tuple[str, ...]:
    """Return the column names of quantities and of their stored uncertainties."""
    suffixes = {False: ("",), True: ("", U_RANDOM, U_SYSTEMATIC)}
    return tuple(q.name + suffix for q in quantities for suffix in suffixes[q.keeps_uncertainty])


FIXED_COLUMNS = columns_of(CATALOGUE)
"""Columns of the quantities that every bearing has."""


def other_columns(names: Iterable[str]) -> tuple[str, ...]:
    """Return the sorted columns of those quantities in `names` that not every bearing has."""
    found = {name: quantity_named(name) for name in names if name not in BY_NAME}
    return columns_of(quantity for _, quantity in sorted(found.items()) if quantity is not None)


@dataclass(frozen=True)
class Layout:
    """Column names of stored rows, and the quality reasons to which quality bytes refer.

    Each row refers to the layout with which it was written, so that quantities can be added later.
    """

    quantities: tuple[str, ...]
    reasons: tuple[str, ...]

    @classmethod
    def of(cls, quantities: tuple[str, ...]) -> "Layout":
        """Return the layout of the given columns with all current quality reasons."""
        return cls(quantities, tuple(reason.value for reason in Reason))

    def dumps(self) -> tuple[str, str]:
        """Return the column names and the quality reasons as JSON texts for storage."""
        return json.dumps(self.quantities), json.dumps(self.reasons)

    @staticmethod
    @lru_cache(maxsize=64)
    def loads(quantities: str, reasons: str) -> "Layout":
        """Return the layout from the JSON texts of `dumps`; cached, since there are few layouts."""
        return Layout(tuple(json.loads(quantities)), tuple(json.loads(reasons)))

    def encode(self, readings: Mapping[str, Reading]) -> tuple[bytes, bytes]:
        """Return values (float64, NaN if missing) and quality bytes, in the order of the layout."""
        values: list[float | None] = []
        qualities = bytearray()
        for name, parts in self._parts:
            reading = readings[name]
            values += [getattr(reading, part) for part in parts]
            byte = reading.quality.level << LEVEL_SHIFT | self._numbers[reading.quality.reason]
            qualities += bytes([byte]) * len(parts)
        return np.array(values, dtype="<f8").tobytes(), bytes(qualities)

    @cached_property
    def _parts(self) -> list[tuple[str, list[str]]]:
        """Quantities of the columns in order, each with the parts of its reading."""
        columns = [column.partition(".") for column in self.quantities]
        return [
            (name, [part or "value" for _, _, part in own])
            for name, own in groupby(columns, key=itemgetter(0))
        ]

    @cached_property
    def _numbers(self) -> dict[str, int]:
        """Number of each quality reason."""
        return {reason: number for number, reason in enumerate(self.reasons)}

    def decode(
        self, values: list[bytes], qualities: list[bytes]
    ) -> tuple[FloatArray, npt.NDArray[np.uint8]]:
        """Return values (NaN if missing) and quality levels, both (n_rows, n_quantities)."""
        shape = (len(values), len(self.quantities))
        number = np.frombuffer(b"".join(values), dtype="<f8").reshape(shape)
        byte = np.frombuffer(b"".join(qualities), dtype=np.uint8).reshape(shape)
        return number.astype(np.float64), (byte >> LEVEL_SHIFT).astype(np.uint8)

    def readings(self, values: bytes, qualities: bytes) -> dict[str, Reading]:
        """Return the readings of one row by quantity, without uncertainties."""
        numbers, _ = self.decode([values], [qualities])
        rows = zip(self.quantities, numbers[0].tolist(), qualities, strict=True)
        return {name: self._reading(value, byte) for name, value, byte in rows if "." not in name}

    def _reading(self, value: float, byte: int) -> Reading:
        level = Level(byte >> LEVEL_SHIFT)
        quality = Quality(level, Reason(self.reasons[byte & ((1 << LEVEL_SHIFT) - 1)]))
        return Reading(None if level is Level.BAD else value, quality)


def remember_layout(writer: Connection, layout: Layout) -> int:
    """Return the stored number of a layout; insert the layout, in the transaction, if it is new."""
    key = layout.dumps()
    writer.execute(
        "INSERT INTO layout (quantities, reasons) VALUES (?, ?) ON CONFLICT DO NOTHING", key
    )
    found = writer.execute("SELECT id FROM layout WHERE quantities = ? AND reasons = ?", key)
    return int(found.fetchone()[0])
