"""Summaries as bytes, some columns at a time, so that a trend reads no more than it shows.

For each column the worst quality, a bit that says whether any reading was usable, and, packed, for
those where one was: count, mean, minimum, maximum.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from service.store.summaries import IntArray, Summaries

PART_COLUMNS = 24
"""Columns of one part: its bytes fit into a page's share, without a chain of further pages."""


def parts_of(columns: tuple[str, ...]) -> tuple[tuple[str, ...], ...]:
    """Columns cut into parts, each with neighbours of the catalogue."""
    return tuple(
        columns[first : first + PART_COLUMNS] for first in range(0, len(columns), PART_COLUMNS)
    )


def encoded(summaries: Summaries) -> list[bytes]:
    """Bytes of each row."""
    usable = summaries.count > 0
    packed = np.packbits(usable, axis=1)
    found: list[bytes] = [b""] * len(packed)
    for pattern, rows in _alike([bits.tobytes() for bits in packed]):
        columns = np.flatnonzero(usable[rows[0]])
        record = np.empty(rows.size, dtype=_record(len(summaries.names), columns.size))
        record["level"] = summaries.level[rows]
        record["usable"] = np.frombuffer(pattern, dtype=np.uint8)
        chosen = np.ix_(rows, columns)
        record["count"] = np.minimum(summaries.count[chosen], np.iinfo(np.uint32).max)
        record["mean"], record["minimum"] = summaries.mean[chosen], summaries.minimum[chosen]
        record["maximum"] = summaries.maximum[chosen]
        for row, one in zip(rows.tolist(), record, strict=True):
            found[row] = one.tobytes()
    return found


def decoded(names: tuple[str, ...], time_ns: IntArray, rows: Sequence[bytes]) -> Summaries:
    """Invert `encoded`."""
    shape, n_head = (len(rows), len(names)), len(names)
    count, level = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.uint8)
    mean, minimum, maximum = (np.full(shape, np.nan) for _ in range(3))
    n_bits = -(-n_head // 8)
    for pattern, where in _alike([row[n_head : n_head + n_bits] for row in rows]):
        usable = np.unpackbits(np.frombuffer(pattern, dtype=np.uint8), count=n_head)
        columns = np.flatnonzero(usable)
        record = np.frombuffer(
            b"".join(rows[row] for row in where.tolist()), dtype=_record(n_head, columns.size)
        )
        level[where] = record["level"]
        chosen = np.ix_(where, columns)
        count[chosen], mean[chosen] = record["count"], record["mean"]
        minimum[chosen], maximum[chosen] = record["minimum"], record["maximum"]
    return Summaries(names, time_ns, count, mean, minimum, maximum, level)


def _record(n_columns: int, n_usable: int) -> np.dtype[np.void]:
    return np.dtype(
        [
            ("level", np.uint8, (n_columns,)),
            ("usable", np.uint8, (-(-n_columns // 8),)),
            ("count", "<u4", (n_usable,)),
            ("mean", "<f8", (n_usable,)),
            ("minimum", "<f8", (n_usable,)),
            ("maximum", "<f8", (n_usable,)),
        ]
    )


def _alike(patterns: list[bytes]) -> list[tuple[bytes, npt.NDArray[np.int64]]]:
    """Rows by the columns in which they have numbers: few patterns, many rows."""
    rows: dict[bytes, list[int]] = {}
    for row, pattern in enumerate(patterns):
        rows.setdefault(pattern, []).append(row)
    return [(pattern, np.array(found)) for pattern, found in rows.items()]
