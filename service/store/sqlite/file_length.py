"""Whether a database file ends where a page ends: SQLite reads what is missing of one as zeros."""

from pathlib import Path

_MAGIC = b"SQLite format 3\0"
_HEADER_BYTES = 100
_PAGE_BYTES_AT = slice(16, 18)
_LARGEST_PAGE = 65_536
"""Written as 1."""


def why_cut(path: Path) -> str | None:
    """Why a database file cannot be whole; None if its length says nothing against it.

    With a log beside it the file may end anywhere: the log holds the page that was being written.
    """
    log = path.with_name(path.name + "-wal")
    if not path.is_file() or (log.exists() and log.stat().st_size):
        return None
    with path.open("rb") as file:
        header = file.read(_HEADER_BYTES)
    size = path.stat().st_size
    if len(header) < _HEADER_BYTES or not header.startswith(_MAGIC):
        return None  # new, or nothing of SQLite's, which says so itself
    written = int.from_bytes(header[_PAGE_BYTES_AT], "big")
    page_bytes = _LARGEST_PAGE if written == 1 else written
    if page_bytes == 0 or size % page_bytes == 0:
        return None
    return f"{size} bytes are no whole pages of {page_bytes}: the end of the file is missing"
