"""Columns of a file of readings: names, conversion and errors."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from core.arrays import TimeArray

MAX_NAMED = 10
"""Maximum number of rows named in an error."""

MAX_SHOWN = 40
"""Maximum number of characters of a wrong value that are shown."""


class RowProblems:
    """Collector of the problems in the rows of a file; its error names the first `MAX_NAMED`.

    Parameters
    ----------
    line : (n,)
        Number of each row in messages.
    word
        Word for `line` in messages: "line" or "row".
    """

    def __init__(self, line: TimeArray, word: str = "line") -> None:
        self._line, self._word = line, word
        self._found: list[tuple[int, str]] = []
        self._n_found = 0

    def add(
        self,
        wrong: npt.NDArray[np.bool_ | np.int64],
        text: str,
        value: Callable[[int], Any] | None = None,
    ) -> None:
        """Add a problem of the rows `wrong`: a mask (n_rows,) or indices.

        `value` returns the value of a row for the message; None for a message without values.
        """
        rows = np.flatnonzero(wrong) if wrong.dtype == np.bool_ else wrong
        self._n_found += rows.size
        lines = self._line[rows]
        for n in np.argsort(lines, kind="stable")[:MAX_NAMED]:
            words = text if value is None else f"{text} {shown(value(int(rows[n])))}"
            self._found.append((int(lines[n]), words))

    def refuse(self) -> None:
        """Raise `ReadingsError` with the first problems and their lines, unless there are none."""
        if not self._found:
            return
        found = sorted(self._found)[:MAX_NAMED]
        messages = [f"{self._word} {line}: {text}" for line, text in found]
        if self._n_found > len(found):
            messages.append(f"and {self._n_found - len(found)} more")
        raise ReadingsError("; ".join(messages))


def shown(value: Any) -> str:
    """Return a wrong value as text for messages, cut after `MAX_SHOWN` characters."""
    text = repr(value)
    return text if len(text) <= MAX_SHOWN else f"{text[:MAX_SHOWN]}…"


TIME, TIME_NS, LINE = "time", "time_ns", "line"
NAMES, OPTIONAL_NAMES = ("unit", "bearing", "direction", "quality"), ("state", "reason")
STIFFNESS = ("k_n_per_m", "u_random")
PER_BEARING = (
    *("eccentricity_ratio", "oil_temperature_c", "speed_rpm", "power_mw"),
    *("u_eccentricity", "attitude_deg"),
)
"""Columns that are the same for both directions."""

AMPLITUDES = ("shaft_um_pk", "bearing_um_pk")
NUMBERS = (*STIFFNESS, *PER_BEARING, *AMPLITUDES)
REQUIRED = (*NAMES, *STIFFNESS, "eccentricity_ratio", "oil_temperature_c")
"""Required columns besides the time; missing numbers of the other columns are NaN."""

TEXTS = (*NAMES, *OPTIONAL_NAMES)
HEADINGS = (TIME, *NAMES, *NUMBERS, *OPTIONAL_NAMES)
"""All columns, in the order in which padwatch writes them."""

SILENT = "insufficient_excitation"
"""Quality, or reason, of a reading without enough motion to measure stiffness."""

MAX_COLUMNS = 100
MAX_ROWS = 40_000_000
"""Rows of one file: 20 units of 3 bearings for 6 years; about 230 bytes of memory each."""


class ReadingsError(ValueError):
    """Error raised for an invalid file of readings; the message names the lines or rows."""


def check_headings(headings: Sequence[str]) -> None:
    """Raise `ReadingsError` if column headings are missing, unknown, repeated or too many."""
    if len(headings) > MAX_COLUMNS:
        raise ReadingsError(f"expected at most {MAX_COLUMNS} columns, got {len(headings)}")
    missing = [key for key in REQUIRED if key not in headings]
    if TIME not in headings and TIME_NS not in headings:
        missing.insert(0, f"{TIME} or {TIME_NS}")
    unknown = [heading for heading in headings if heading not in (TIME_NS, *HEADINGS)]
    twice = sorted({heading for heading in headings if headings.count(heading) > 1})
    problems = []
    if missing:
        problems.append(f"missing columns: {', '.join(missing)}")
    if unknown:
        known = ", ".join((TIME_NS, *HEADINGS))
        problems.append(f"unknown columns: {_listed(unknown)}; known columns: {known}")
    if twice:
        problems.append(f"repeated columns: {_listed(twice)}")
    if TIME in headings and TIME_NS in headings:
        problems.append(f"columns {TIME} and {TIME_NS} are both given; remove one")
    if problems:
        raise ReadingsError("; ".join(problems))


def _listed(names: list[str]) -> str:
    return ", ".join(shown(name) for name in names[:10]) + (", …" if len(names) > 10 else "")


_UTC = pa.timestamp("ns", tz="UTC")
_NO_TIME = "time is not ISO 8601 with an offset from UTC, such as 2026-03-01T08:00:00Z:"
REASON, NO_REASON = "reason", "ok"
"""Name of the column, and its value for a good reading."""

_TIMES = "use 2026-03-01T08:00:00Z or timestamps with a zone; name a column of ns time_ns"


def converted(table: Any, line: Any, word: str) -> Any:
    """Return an Arrow table as a record batch with the required types and a column of line numbers.

    Times are ns since 1970 UTC; missing numbers are NaN, missing reasons `NO_REASON`.

    Parameters
    ----------
    line : (n,)
        Number of each row in messages.
    word
        Word for `line` in messages: "line" or "row".

    Raises
    ------
    ReadingsError
        If a value is wrong; the message names lines and values.
    """
    texts = [(key, pa.string()) for key in TEXTS if key in table.column_names]
    numbers = [(key, pa.float64()) for key in NUMBERS if key in table.column_names]
    schema = pa.schema([(TIME_NS, pa.int64()), *texts, *numbers, (LINE, pa.int64())])
    problems = RowProblems(line, word)
    columns = []
    for field in schema:
        if field.name == LINE:
            columns.append(pa.array(line))
        elif field.name == TIME_NS:
            columns.append(_time_ns(table, problems))
        else:
            convert = _text if field.type == pa.string() else _number
            columns.append(convert(table.column(field.name), field.name, problems))
    problems.refuse()
    return pa.record_batch(columns, schema=schema)


def _time_ns(table: Any, problems: RowProblems) -> Any:
    if TIME_NS in table.column_names:
        column = _flat(table.column(TIME_NS))
        if not (_is_text(column.type) or pa.types.is_integer(column.type)):
            raise ReadingsError(f"column {TIME_NS} of type {column.type}: values must be integers")
        return _cast(column, pa.int64(), f"{TIME_NS} is not an integer:", problems)
    column = _flat(table.column(TIME))
    is_stamp = pa.types.is_timestamp(column.type) and column.type.tz is not None
    if not (_is_text(column.type) or is_stamp):
        raise ReadingsError(f"column {TIME} of type {column.type}: {_TIMES}")
    return _cast(column, _UTC, _NO_TIME, problems).cast(pa.int64())


def _number(column: Any, key: str, problems: RowProblems) -> Any:
    column, kind = _flat(column), column.type
    is_number = pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_null(kind)
    if not (is_number or _is_text(kind)):
        raise ReadingsError(f"column {key} of type {kind}: values must be numbers")
    return _cast(column, pa.float64(), f"{key} is not a number:", problems, may_be_empty=True)


def _text(column: Any, key: str, problems: RowProblems) -> Any:
    kind = column.type
    if not _is_text(kind.value_type if pa.types.is_dictionary(kind) else kind):
        raise ReadingsError(f"column {key} of type {kind}: values must be texts")
    found = _flat(column.cast(pa.string()))
    if key == REASON:
        return found.fill_null(NO_REASON)
    problems.add(_is_null(found), f"{key} is missing")
    return found.fill_null("")


def _cast(
    column: Any, kind: Any, text: str, problems: RowProblems, may_be_empty: bool = False
) -> Any:
    """Convert a column; if that fails, find the wrong values one by one."""
    if not may_be_empty:
        problems.add(_is_null(column), f"{text} nothing")
    try:
        found = pc.cast(column, kind)
    except pa.ArrowInvalid:
        fits = [_fits(column.slice(row, 1), kind) for row in range(len(column))]
        problems.add(~np.array(fits), text, lambda row: _python_value(column[row]))
        found = pa.nulls(len(column), kind)
    return found.fill_null(np.nan if pa.types.is_floating(kind) else 0)


def _fits(value: Any, kind: Any) -> bool:
    try:
        pc.cast(value, kind)
    except pa.ArrowInvalid:
        return False
    return True


def _python_value(value: Any) -> Any:
    """Return a value for a message; times may be outside Python's range."""
    is_stamp = pa.types.is_timestamp(value.type) and value.is_valid
    return f"{value.value} {value.type.unit} since 1970" if is_stamp else value.as_py()


def _is_null(column: Any) -> Any:
    return column.is_null().to_numpy(zero_copy_only=False)


def _flat(column: Any) -> Any:
    return column.combine_chunks() if column.num_chunks == 1 else pa.concat_arrays(column.chunks)


def _is_text(kind: Any) -> bool:
    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind))
