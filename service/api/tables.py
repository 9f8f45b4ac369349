"""Tables as answers, CSV and Parquet files, and the audit trail as a CSV file."""

import csv
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import astuple, dataclass, fields
from io import BytesIO, StringIO
from itertools import islice
from types import NoneType
from typing import Annotated, Any, Literal, TextIO, get_args

import pyarrow as pa
import pyarrow.parquet as pq
from fastapi import Depends, Request
from fastapi.responses import StreamingResponse
from pydantic import BaseModel

from service.api.downloads import attachment
from service.api.parameters import parameter
from service.runtime.times import rfc3339
from service.store.access.audit_entries import AuditEntry

FormatName = Literal["json", "csv", "parquet"]
ColumnKind = Literal["time", "number", "count", "text", "flag"]

MEDIA_TYPES: dict[str, FormatName] = {
    "application/json": "json",
    "text/csv": "csv",
    "application/vnd.apache.parquet": "parquet",
}
CURSOR_HEADER = "Padwatch-Next-Cursor"

CURSOR = {
    "description": "In tables, the cursor of the next page; absent on the last page.",
    "schema": {"type": "string"},
    "example": "1795248192400000000",
}

CSV_EXAMPLE = "time_utc,speed_rpm_mean [r/min]\r\n2026-11-21T09:03:12.400Z,90.91\r\n"

TYPE_OF = {name: media_type for media_type, name in MEDIA_TYPES.items()}

ROWS_AT_ONCE = 500

ARROW_TYPES: dict[ColumnKind, Any] = {
    "time": pa.timestamp("ns", tz="UTC"),
    "number": pa.float64(),
    "count": pa.int64(),
    "text": pa.string(),
    "flag": pa.bool_(),
}


COLUMN_KINDS: dict[type, ColumnKind] = {bool: "flag", int: "count", float: "number"}


def kind_of(annotation: Any) -> ColumnKind:
    """Return the column kind for the type annotation of a value, or of a list of values."""
    inner = [each for each in get_args(annotation) if each is not NoneType]
    is_leaf = not inner or isinstance(inner[0], str)  # text is a member of a Literal
    return COLUMN_KINDS.get(annotation, "text") if is_leaf else kind_of(inner[0])


@dataclass(frozen=True)
class Column:
    """Column of a tabular answer.

    Parameters
    ----------
    values
        Value or None for each row; times are in nanoseconds since 1970 UTC.
    unit
        Unit of the values, for an amplitude also the detector; None if the values have no unit.
    """

    name: str
    kind: ColumnKind
    values: Sequence[Any]
    unit: str | None = None

    @property
    def heading(self) -> str:
        """Column heading: the name, with the unit in brackets."""
        return harmless(self.name if self.unit is None else f"{self.name} [{self.unit}]")


UNITS = {
    "_n_per_m": "N/m",
    "_of_kb": "1",
    "_um_pk": "µm 0-pk",
    "_percent": "%",
    "_rpm": "r/min",
    "_mw": "MW",
    "_ratio": "1",
    "_deg": "deg",
    "_c": "°C",
    "_s": "s",
}
"""Units of table columns, by suffix of the column name."""


def column_of(model: type[BaseModel], name: str, values: Sequence[Any], prefix: str = "") -> Column:
    """Return the column of a field of a model: kind and unit are those of the field.

    `name` is the name of the field; the name of the column begins with `prefix`.
    """
    unit = next((unit for end, unit in UNITS.items() if name.endswith(end)), None)
    return Column(prefix + name, kind_of(model.model_fields[name].annotation), values, unit)


async def wanted_format(
    request: Request,
    format: Annotated[  # noqa: A002  the name that callers know
        FormatName | None,
        parameter("Format of the answer; default: that of the header Accept, or JSON.", "csv"),
    ] = None,
) -> FormatName:
    """Return the format requested by the query, else by the header Accept, else JSON."""
    if format is not None:
        return format
    accepted = request.headers.get("accept", "").split(",")
    asked = (each.partition(";")[0].strip() for each in accepted)
    return next((MEDIA_TYPES[each] for each in asked if each in MEDIA_TYPES), "json")


Format = Annotated[FormatName, Depends(wanted_format)]


def table_content(words: str) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI entry of an answer, described by `words`, in JSON, CSV and Parquet."""
    binary = {"schema": {"type": "string", "format": "binary"}}
    text = {"schema": {"type": "string"}, "example": CSV_EXAMPLE}
    content = {TYPE_OF["csv"]: text, TYPE_OF["parquet"]: binary}
    return {200: {"description": words, "content": content, "headers": {CURSOR_HEADER: CURSOR}}}


def table_response(
    wanted: FormatName, columns: Sequence[Column], name: str, next_cursor: str | int | None = None
) -> StreamingResponse:
    """Return a response with a table as a CSV or Parquet file.

    `name` is the name of the file without suffix; `next_cursor` is the value of the header
    `CURSOR_HEADER`, or None to omit the header.
    """
    pieces = csv_pieces(columns) if wanted == "csv" else iter([parquet_file(columns)])
    cursor = {} if next_cursor is None else {CURSOR_HEADER: str(next_cursor)}
    return attachment(pieces, TYPE_OF[wanted], f"{name}.{wanted}", Vary="Accept", **cursor)


def csv_pieces(columns: Sequence[Column]) -> Iterator[bytes]:
    """Yield the pieces of a CSV file (RFC 4180), with text escaped against formula injection."""
    sink = StringIO(newline="")
    writer = csv.writer(sink)
    writer.writerow([column.heading for column in columns])
    rows = zip(*(_cells(column) for column in columns), strict=True)
    while True:
        some = list(islice(rows, ROWS_AT_ONCE))
        writer.writerows(some)
        yield sink.getvalue().encode()
        sink.seek(0)
        sink.truncate()
        if len(some) < ROWS_AT_ONCE:
            return


def parquet_file(columns: Sequence[Column]) -> bytes:
    """Return a table as a Parquet file; the metadata of each column contains its unit."""
    fields = [
        pa.field(each.name, ARROW_TYPES[each.kind], metadata={"unit": each.unit or ""})
        for each in columns
    ]
    sink = BytesIO()
    table = pa.table({each.name: each.values for each in columns}, schema=pa.schema(fields))
    pq.write_table(table, sink, compression="zstd")
    return sink.getvalue()


def _cells(column: Column) -> Iterator[object]:
    if column.kind == "time":
        return map(rfc3339, column.values)
    return map(_cell, column.values) if column.kind == "text" else iter(column.values)


HEADER = ("time", "chain", *(field.name for field in fields(AuditEntry)))

FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "|", "%", "'", "＝", "＋", "－", "＠")
"""First characters of spreadsheet formulas, and the single quote to make escaping reversible."""


def write_csv(file: TextIO, entries: Iterable[tuple[str, AuditEntry]]) -> int:
    """Write pairs of chain name and audit entry to an open CSV file; return their number.

    Text that a spreadsheet could interpret as a formula is prefixed with a single quote.
    """
    rows = csv.writer(file, quoting=csv.QUOTE_ALL, lineterminator="\r\n")
    rows.writerow(HEADER)
    n_entries = 0
    for chain, entry in entries:
        rows.writerow([rfc3339(entry.time_ns), chain, *map(_cell, astuple(entry))])
        n_entries += 1
    return n_entries


def harmless(text: str) -> str:
    """Return a text escaped against formula injection, with invalid characters replaced."""
    text = text.encode("utf-8", "replace").decode("utf-8").replace("\0", "\ufffd")
    is_formula = text.lstrip(" \u00a0\ufeff").startswith(FORMULA) or text.startswith(FORMULA)
    return f"'{text}" if is_formula else text


def _cell(value: object) -> object:
    return harmless(value) if isinstance(value, str) else value
