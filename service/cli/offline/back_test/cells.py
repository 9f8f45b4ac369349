"""Columns as files have them, into the types that are handed on; what does not fit is named."""

from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from service.cli.offline.back_test.file_columns import LINE, TIME, TIME_NS, ReadingsError, schema_of
from service.cli.offline.back_test.problems import RowProblems

_UTC = pa.timestamp("ns", tz="UTC")
_NO_TIME = "not a time of ISO 8601 with an offset from UTC, like 2026-03-01T08:00:00Z:"
REASON, NO_REASON = "reason", "ok"
"""A reading that is good needs no reason."""

_TIMES = "must be texts like 2026-03-01T08:00:00Z or timestamps with a zone; whole ns are time_ns"


def converted(table: Any, line: Any, word: str) -> Any:
    """Convert all columns of a table.

    Parameters
    ----------
    line : (n,)
        Number of each row in messages.
    word
        What such a number counts: lines or rows.

    Raises
    ------
    ReadingsError
        Naming lines and values.
    """
    schema, problems = schema_of(table.column_names), RowProblems(line, word)
    columns = []
    for field in schema:
        if field.name == LINE:
            columns.append(pa.array(line))
        elif field.name == TIME_NS:
            columns.append(_time_ns(table, problems))
        else:
            convert = _text if field.type == pa.string() else _number
            columns.append(convert(table.column(field.name), field.name, problems))
    try:
        problems.refuse()
    except ValueError as error:
        raise ReadingsError(str(error)) from error
    return pa.record_batch(columns, schema=schema)


def _time_ns(table: Any, problems: RowProblems) -> Any:
    if TIME_NS in table.column_names:
        column = _flat(table.column(TIME_NS))
        if not (_is_text(column.type) or pa.types.is_integer(column.type)):
            raise ReadingsError(f"column {TIME_NS} of type {column.type}: must be integers")
        return _cast(column, pa.int64(), f"{TIME_NS} is no integer:", problems)
    column = _flat(table.column(TIME))
    is_stamp = pa.types.is_timestamp(column.type) and column.type.tz is not None
    if not (_is_text(column.type) or is_stamp):
        raise ReadingsError(f"column {TIME} of type {column.type}: {_TIMES}")
    return _cast(column, _UTC, _NO_TIME, problems).cast(pa.int64())


def _number(column: Any, key: str, problems: RowProblems) -> Any:
    """Numbers, NaN where there is none."""
    column, kind = _flat(column), column.type
    is_number = pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_null(kind)
    if not (is_number or _is_text(kind)):
        raise ReadingsError(f"column {key} of type {kind}: must be numbers")
    return _cast(column, pa.float64(), f"{key} is no number:", problems, may_be_empty=True)


def _text(column: Any, key: str, problems: RowProblems) -> Any:
    kind = column.type
    if not _is_text(kind.value_type if pa.types.is_dictionary(kind) else kind):
        raise ReadingsError(f"column {key} of type {kind}: must be texts")
    found = _flat(column.cast(pa.string()))
    if key == REASON:
        return found.fill_null(NO_REASON)
    problems.add(_is_null(found), f"{key} is missing")
    return found.fill_null("")


def _cast(
    column: Any, kind: Any, text: str, problems: RowProblems, may_be_empty: bool = False
) -> Any:
    """Convert a column at once, or look for what does not fit, value by value."""
    if not may_be_empty:
        problems.add(_is_null(column), f"{text} nothing")
    try:
        found = pc.cast(column, kind)
    except pa.ArrowInvalid:
        fits = [_fits(column.slice(row, 1), kind) for row in range(len(column))]
        problems.add(~np.array(fits), text, lambda row: _said(column[row]))
        found = pa.nulls(len(column), kind)
    return found.fill_null(np.nan if pa.types.is_floating(kind) else 0)


def _fits(value: Any, kind: Any) -> bool:
    try:
        pc.cast(value, kind)
    except pa.ArrowInvalid:
        return False
    return True


def _said(value: Any) -> Any:
    """A value for a message; times may be beyond what Python has."""
    is_stamp = pa.types.is_timestamp(value.type) and value.is_valid
    return f"{value.value} {value.type.unit} since 1970" if is_stamp else value.as_py()


def _is_null(column: Any) -> Any:
    return column.is_null().to_numpy(zero_copy_only=False)


def _flat(column: Any) -> Any:
    return column.combine_chunks() if column.num_chunks == 1 else pa.concat_arrays(column.chunks)


def _is_text(kind: Any) -> bool:
    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind))
