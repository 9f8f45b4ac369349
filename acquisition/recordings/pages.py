"""How much memory a Parquet file takes when it is read, found out before pyarrow reads it.

pyarrow allocates for a page whatever the page's header says it unpacks to, up to 2 GB for a page
of 64 kB. So footer and page headers are walked first; only what a recording can need may pass.
Source of the field numbers: parquet.thrift of Apache Parquet 2.11.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, BinaryIO

from acquisition.recordings.limits import MAX_REASON_LENGTH, MAX_REJECTIONS
from acquisition.recordings.thrift import I32, I64, LIST, STRUCT, Struct, ThriftError, ThriftReader

_ZSTD = 6
_DATA_PAGE, _DICTIONARY_PAGE = 0, 2
_HEADER_BYTES = 1024
"""Longest page header; padwatch's own have 25 bytes, for want of statistics."""

_SLACK_BYTES = 65_536
_EXPANDED_BYTES = 2**26
"""Most that the texts of one row group may take."""

_IN_COLUMN_CHUNK = {2, 3, 4, 5, 6, 7}
"""Known fields of a column chunk but the name of another file and what encryption needs."""


class PageError(ValueError):
    """Footer or pages that are not those of a recording; the message says why."""


@dataclass(frozen=True)
class ColumnLimits:
    """What a column of one row group may hold.

    Parameters
    ----------
    values_per_row
        Most values in a row; 1 if it is exactly one.
    bytes_per_value
        Of an unpacked value.
    is_text
        Whether values can be of any length, so that a dictionary can multiply them.
    """

    values_per_row: int = 1
    bytes_per_value: int = 8
    is_text: bool = False


NUMBER = ColumnLimits()
REJECTED_COUNT = ColumnLimits(MAX_REJECTIONS)
REJECTED_REASON = ColumnLimits(MAX_REJECTIONS, 4 * MAX_REASON_LENGTH, is_text=True)


def read_footer(stream: BinaryIO, footer_at: int) -> Struct:
    """Read the footer, whose end is eight bytes before that of the file.

    Raises
    ------
    PageError
        If its lists cannot be as long as they say, or it is encrypted.
    """
    size = stream.seek(0, 2)
    stream.seek(footer_at)
    footer = _struct(ThriftReader(stream.read(size - 8 - footer_at)))
    if {8, 9} & footer.keys():
        raise PageError("encrypted")
    return footer


def require_bounded(
    stream: BinaryIO,
    footer_at: int,
    footer: Struct,
    columns: Sequence[ColumnLimits],
    group_rows: Sequence[int],
) -> None:
    """Refuse a file that could unpack to more than its rows can need.

    Parameters
    ----------
    footer_at
        Where the footer begins: all pages are before it.
    columns
        Of the leaf columns in their order.
    group_rows
        Rows of each row group.

    Raises
    ------
    PageError
        If it could, or if anything is not as padwatch writes it.
    """
    groups = _structs(footer, 4)
    if len(groups) != len(group_rows):
        raise PageError(f"{len(groups)} row groups, expected are {len(group_rows)}")
    for group, n_rows in zip(groups, group_rows, strict=True):
        chunks = _structs(group, 1)
        if len(chunks) != len(columns):
            raise PageError(f"a row group of {len(chunks)} columns, expected are {len(columns)}")
        for chunk, limits in zip(chunks, columns, strict=True):
            _require_bounded_chunk(stream, footer_at, chunk, limits, n_rows)


def _require_bounded_chunk(
    stream: BinaryIO, footer_at: int, chunk: Struct, limits: ColumnLimits, n_rows: int
) -> None:
    if not chunk.keys() <= _IN_COLUMN_CHUNK:
        raise PageError("a column in another file")
    column: Struct = _field(chunk, 3, STRUCT)
    if _field(column, 4, I32) != _ZSTD:
        raise PageError("a column that is not packed by zstd")
    start, n_bytes = _field(column, 9, I64), _field(column, 7, I64)
    if 11 in column:
        start = min(start, _field(column, 11, I64) or start)
    if not 4 <= start <= start + n_bytes <= footer_at:
        raise PageError(f"a column of {n_bytes} bytes at {start}, outside of the file")
    n_values, n_unpacked, n_dictionary = 0, 0, 0
    for page in _pages(stream, start, start + n_bytes):
        n_values += page.n_values if not page.is_dictionary else 0
        n_dictionary += page.n_unpacked if page.is_dictionary else 0
        n_unpacked += page.n_unpacked
    least, most = (n_rows, n_rows * limits.values_per_row)
    if not least <= n_values <= most:
        raise PageError(f"a column of {n_values} values where {n_rows} rows have {least} to {most}")
    allowed = 2 * most * (limits.bytes_per_value + 4) + _SLACK_BYTES
    if n_unpacked > allowed or n_bytes > allowed:
        raise PageError(f"a column that unpacks to {n_unpacked} bytes, at most {allowed} belong")
    if limits.is_text and n_values * n_dictionary > _EXPANDED_BYTES:
        raise PageError(f"{n_values} texts out of a dictionary of {n_dictionary} bytes")


@dataclass(frozen=True)
class _Page:
    is_dictionary: bool
    n_values: int
    n_unpacked: int


def _pages(stream: BinaryIO, start: int, stop: int) -> Iterator[_Page]:
    at = start
    while at < stop:
        stream.seek(at)
        reader = ThriftReader(stream.read(min(_HEADER_BYTES, stop - at)))
        header = _struct(reader)
        kind, n_packed = _field(header, 1, I32), _field(header, 3, I32)
        if kind not in (_DATA_PAGE, _DICTIONARY_PAGE) or (kind == _DICTIONARY_PAGE and at > start):
            raise PageError(f"a page of kind {kind} at {at}")
        own: Struct = _field(header, 5 if kind == _DATA_PAGE else 7, STRUCT)
        page = _Page(kind == _DICTIONARY_PAGE, _field(own, 1, I32), _field(header, 2, I32))
        if page.is_dictionary and 4 * page.n_values > page.n_unpacked:
            raise PageError(f"{page.n_values} entries in {page.n_unpacked} bytes of dictionary")
        yield page
        at += reader.position + n_packed
    if at != stop:
        raise PageError(f"pages that end at {at} in a column that ends at {stop}")


def _struct(reader: ThriftReader) -> Struct:
    try:
        return reader.struct()
    except ThriftError as error:
        raise PageError(f"damaged: {error}") from error


def _structs(fields: Struct, number: int) -> list[Struct]:
    found = _field(fields, number, LIST)
    if any(element.type != STRUCT for element in found):
        raise PageError(f"field {number} is no list of structs")
    return [element.value for element in found]


def _field(fields: Struct, number: int, type_: int) -> Any:
    found = fields.get(number)
    if found is None or found.type != type_:
        raise PageError(f"field {number} is not there, or not of its type")
    if isinstance(found.value, int) and found.value < 0:
        raise PageError(f"field {number} is {found.value}")
    return found.value
