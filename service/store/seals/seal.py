"""The seal of a row: a checksum of its table's name and of all that is in it."""

import marshal
import zlib

Cell = int | float | bytes | None
"""Of a stored row; texts as their bytes, for what is damaged need not be text."""

FORMAT = 1
"""Of seals; what has seals of another one is sealed anew."""

_VERSION = 2
"""Of Python's own way to write values: kinds, lengths and all bits of numbers, nothing else.

Later ones write what is there twice as a reference, so that equal rows may look different.
"""


def begun(table: str) -> int:
    """What the seals of a table begin with."""
    return zlib.crc32(table.encode())


def seal_of(begun_with: int, cells: tuple[Cell, ...]) -> int:
    """CRC-32 of a row of a table, which is given by what its seals begin with."""
    return zlib.crc32(marshal.dumps(cells, _VERSION), begun_with)
