"""The seal of a row: a checksum of its table's name and of all that is in it."""

import zlib
from collections.abc import Sequence

Cell = int | float | bytes | None
"""Of a stored row; texts as their bytes, for what is damaged need not be text."""


def seal_of(table: str, cells: Sequence[Cell]) -> int:
    """CRC-32 of a row.

    Numbers count by how Python writes them, which is one text for one number; bytes by their
    lengths there, and by themselves after it.
    """
    head = repr([len(cell) if type(cell) is bytes else cell for cell in cells])
    crc = zlib.crc32(head.encode("ascii"), zlib.crc32(table.encode("ascii")))
    for cell in cells:
        if type(cell) is bytes:
            crc = zlib.crc32(cell, crc)
    return crc
