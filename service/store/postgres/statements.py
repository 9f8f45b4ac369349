"""Statements with their parameters as psycopg writes them."""

import re
from functools import lru_cache

_PIECE = re.compile(r"('(?:[^']|'')*')|\?|(?<!:):([A-Za-z_][A-Za-z_0-9]*)|%|\bwhole_(?=[a-z])")


@lru_cache(maxsize=1024)
def translated(statement: str) -> bytes:
    """Write ``?`` as ``%s`` and ``:name`` as ``%(name)s``; what is quoted stays as it is.

    ``whole_`` before a table is left out: the server sees to it that what it reads is whole.
    """
    return _PIECE.sub(_piece, statement).encode()


def _piece(found: re.Match[str]) -> str:
    quoted, name = found[1], found[2]
    if quoted is not None:
        return quoted.replace("%", "%%")
    if name is not None:
        return f"%({name})s"
    return {"?": "%s", "%": "%%"}.get(found[0], "")
