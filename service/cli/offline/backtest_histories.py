"""Histories of bearings from checked rows of readings."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.baseline.history import DIRECTIONS, CodeArray, ReadingOutcome, StiffnessHistory
from core.condition.operating_state import OperatingState
from core.quality import Reason
from service.cli.offline.backtest_cells import (
    AMPLITUDES,
    LINE,
    NUMBERS,
    PER_BEARING,
    SILENT,
    STIFFNESS,
    TIME_NS,
    RowProblems,
)

Place: TypeAlias = tuple[str, str]
"""Unit and bearing."""

QUALITIES = {
    "good": ReadingOutcome.MEASURED,
    "uncertain": ReadingOutcome.BAD_QUALITY,
    "bad": ReadingOutcome.BAD_QUALITY,
    SILENT: ReadingOutcome.INSUFFICIENT_EXCITATION,
}
"""Outcome of a reading by quality; uncertain readings are neither learned nor judged."""

STATES = {state.name.lower(): state for state in OperatingState}
_KNOWN: Mapping[str, Collection[str]] = {
    "direction": DIRECTIONS,
    "quality": QUALITIES,
    "state": STATES,
    "reason": [reason.value for reason in Reason],
}
_Rows = npt.NDArray[np.int64]
_UNSIGNED = (*AMPLITUDES, "eccentricity_ratio", "u_eccentricity")


@dataclass(frozen=True, eq=False)
class BearingRows:
    """Readings of one bearing from a file, with the operating state of each.

    Parameters
    ----------
    state : (n,)
        Values of `OperatingState`; None if the file has no column of states.
    n_rows
        Number of rows of the file in direction x and in direction y.
    """

    history: StiffnessHistory
    state: CodeArray | None
    n_rows: tuple[int, int]


def histories_of(
    columns: Mapping[str, Any], places: Collection[Place] | None = None, word: str = "line"
) -> dict[Place, BearingRows]:
    """Return the history of each bearing, with the rows of both directions merged by time.

    Parameters
    ----------
    columns
        Columns of one length (n,), named as by `converted`: texts as `pyarrow.DictionaryArray`,
        numbers as numpy arrays with NaN for missing numbers.
    places
        Pairs of unit and bearing that exist, others are an error; None allows all.
    word
        Word for the column `line` in messages: "line" or "row".

    Raises
    ------
    ReadingsError
        If names are unknown, numbers invalid, rows out of order or repeated, or the directions of
        one time differ in a column of the bearing; the message names the lines.
    """
    problems = RowProblems(columns[LINE], word)
    _check_names(columns, places, problems)
    _check_numbers(columns, problems)
    problems.refuse()
    found = {place: _merged(columns, rows, problems) for place, rows in _by_place(columns)}
    problems.refuse()
    return found


def _mapped(
    column: Any, values: Mapping[str, Any], default: Any, rows: _Rows | slice = slice(None)
) -> npt.NDArray[Any]:
    names = column.dictionary.to_pylist()
    found = np.array([values.get(name, default) for name in names] or [default])
    return np.asarray(found[column.indices.to_numpy()[rows]])


def _is_in(
    column: Any, known: Collection[str], rows: _Rows | slice = slice(None)
) -> npt.NDArray[np.bool_]:
    return _mapped(column, dict.fromkeys(known, True), False, rows)


def _check_names(
    columns: Mapping[str, Any], places: Collection[Place] | None, problems: RowProblems
) -> None:
    def name(key: str) -> Any:
        return lambda row: columns[key][row].as_py()

    for key, known in _KNOWN.items():
        if key in columns:
            problems.add(~_is_in(columns[key], known), f"unknown {key}", name(key))
    units = sorted({unit for unit, _ in places or ()})
    if places is not None:
        problems.add(~_is_in(columns["unit"], units), "unknown unit", name("unit"))
    for unit in units:
        bearings = [b for u, b in places or () if u == unit]
        wrong = _is_in(columns["unit"], [unit]) & ~_is_in(columns["bearing"], bearings)
        problems.add(wrong, f"unit {unit} has no bearing", name("bearing"))
    if "reason" in columns:
        wrong = _is_in(columns["quality"], ["good"]) & ~_is_in(columns["reason"], ["ok"])
        problems.add(wrong, "quality must not be good for the reason", name("reason"))


def _check_numbers(columns: Mapping[str, Any], problems: RowProblems) -> None:
    is_good = _is_in(columns["quality"], ["good"])
    for key in (key for key in NUMBERS if key in columns):
        column = columns[key]
        if key in STIFFNESS:
            wrong = (is_good & ~(column > 0.0)) | (column <= 0.0)
            problems.add(wrong, f"{key} must be above 0, got", column.item)
        if key in _UNSIGNED:
            problems.add(column < 0.0, f"{key} must not be below 0, got", column.item)
        problems.add(np.isinf(column), f"{key} must be finite, got", column.item)


def _by_place(columns: Mapping[str, Any]) -> list[tuple[Place, _Rows]]:
    unit, bearing = (columns[key].indices.to_numpy() for key in ("unit", "bearing"))
    key = unit.astype(np.int64) * len(columns["bearing"].dictionary) + bearing
    order = np.argsort(key, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(key[order])) + 1)
    found = [
        ((columns["unit"][int(rows[0])].as_py(), columns["bearing"][int(rows[0])].as_py()), rows)
        for rows in parts
        if rows.size
    ]
    return sorted(found, key=lambda item: item[0])


def _outcome(columns: Mapping[str, Any], rows: _Rows) -> npt.NDArray[Any]:
    found = _mapped(columns["quality"], QUALITIES, ReadingOutcome.BAD_QUALITY, rows)
    if "reason" in columns:
        is_silent = _is_in(columns["quality"], ["bad"], rows)
        is_silent &= _is_in(columns["reason"], [SILENT], rows)
        found[is_silent] = ReadingOutcome.INSUFFICIENT_EXCITATION
    return found


def _merged(columns: Mapping[str, Any], rows: _Rows, problems: RowProblems) -> BearingRows:
    row_ns = columns[TIME_NS][rows]
    time_ns = np.unique(row_ns)
    sides = [np.flatnonzero(_is_in(columns["direction"], [name], rows)) for name in DIRECTIONS]
    slots = [np.searchsorted(time_ns, row_ns[side]) for side in sides]
    for side in sides:
        step_ns, later = np.diff(row_ns[side]), rows[side[1:]]
        problems.add(later[step_ns == 0], "two rows have the same time")
        problems.add(later[step_ns < 0], "time is earlier than in the previous row")

    def both(column: npt.NDArray[Any] | None) -> FloatArray:
        """Return (2, n) values by direction; NaN for a missing row or column."""
        found = np.full((len(DIRECTIONS), time_ns.size), np.nan)
        for row, (side, slot) in enumerate(zip(sides, slots, strict=True)):
            if column is not None:
                found[row, slot] = column[side]
        return found

    def one(key: str, column: npt.NDArray[Any] | None) -> FloatArray:
        """Return (n,) values of y, or of x without a row of y; NaN if `column` is None.

        A value of x and y that differs at one time is added to `problems` under the name `key`.
        """
        x, y = both(column)
        differs = ~((x == y) | np.isnan(x) & np.isnan(y))
        wrong = np.isin(slots[1], slots[0]) & differs[slots[1]]
        problems.add(rows[sides[1][wrong]], f"{key} differs from that of direction x")
        has_y = np.isin(np.arange(time_ns.size), slots[1])
        return np.asarray(np.where(has_y, y, x))

    numbers = {key: columns[key][rows] for key in NUMBERS if key in columns}
    outcome = np.nan_to_num(both(_outcome(columns, rows)), nan=ReadingOutcome.BAD_QUALITY)
    k_n_per_m, u_random = (both(numbers[key]) for key in STIFFNESS)
    is_measured = outcome == ReadingOutcome.MEASURED
    history = StiffnessHistory(
        time_ns=time_ns,
        ln_k=np.log(np.where(is_measured, k_n_per_m, np.nan)),
        u_random=np.where(is_measured, u_random, np.nan),
        outcome=outcome.astype(np.int8),
        shaft_um_pk=both(numbers.get("shaft_um_pk")),
        bearing_um_pk=both(numbers.get("bearing_um_pk")),
        **{key: one(key, numbers.get(key)) for key in PER_BEARING},
    )
    state = None
    if "state" in columns:
        states = _mapped(columns["state"], STATES, OperatingState.UNKNOWN, rows)
        state = one("state", states).astype(np.int8)
    x, y = sides
    return BearingRows(history, state, (x.size, y.size))
