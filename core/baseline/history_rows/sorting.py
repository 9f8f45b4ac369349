"""Sorting rows into one history per bearing."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray, TimeArray
from core.baseline.history import DIRECTIONS, CodeArray, ReadingOutcome, StiffnessHistory
from core.baseline.history_rows.columns import (
    AMPLITUDES,
    PER_BEARING,
    STIFFNESS,
    Columns,
    Place,
    Rows,
)
from core.baseline.history_rows.problems import RowProblems

_Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class BearingRows:
    """Readings of one bearing.

    Parameters
    ----------
    state : (n,)
        Members of `OperatingState`; None if the rows do not say it.
    n_rows
        Rows of each direction.
    """

    history: StiffnessHistory
    state: CodeArray | None
    n_rows: tuple[int, int]


def histories_from_columns(
    columns: Columns,
    places: Collection[Place] | None = None,
    line: TimeArray | None = None,
    word: str = "line",
) -> dict[Place, BearingRows]:
    """Sort rows of many bearings and both directions into histories.

    Parameters
    ----------
    columns
        Those of `REQUIRED`; optionally `state` (a name of `OperatingState`), `reason` (of the
        quality) and the others. `quality` is a key of `QUALITIES`, `u_random` relative to the
        stiffness; NaN where there is no number.
    places
        Units and bearings that there are; any, if not given.
    line : (n,)
        Number of each row in messages; by default they count from 2, below a heading.
    word
        What such a number counts: lines or rows.

    Raises
    ------
    ValueError
        If columns are missing, unknown or of unequal length, names are unknown, numbers are
        impossible, rows out of order or there twice, or the two directions of one time disagree on
        what is one for both; with line numbers.
    """
    rows = Rows.of(columns)
    line = np.arange(2, rows.time_ns.size + 2) if line is None else line
    problems = RowProblems(line, word)
    rows.check(places, problems)
    problems.refuse()
    of_bearing = dict(_by_place(rows))
    for found in of_bearing.values():
        _Merge(rows, found).check(problems)
    problems.refuse()
    return {place: _Merge(rows, found).merged() for place, found in of_bearing.items()}


def _by_place(rows: Rows) -> Iterator[tuple[Place, _Ints]]:
    """Rows of each bearing, in their order."""
    unit, bearing = rows.names["unit"], rows.names["bearing"]
    place = unit.code.astype(np.int64) * len(bearing.names) + bearing.code
    order = np.argsort(place, kind="stable")
    starts = np.flatnonzero(np.diff(place[order], prepend=-1))
    found = {
        (unit.names[unit.code[of[0]]], bearing.names[bearing.code[of[0]]]): of
        for of in np.split(order, starts[1:])
        if of.size
    }
    yield from sorted(found.items())


class _Merge:
    """Rows of one bearing, and where each direction's rows lie on the common axis of time."""

    def __init__(self, rows: Rows, of_bearing: _Ints) -> None:
        self._rows = rows.rows(of_bearing)
        self._of_bearing = of_bearing
        self._time_ns = np.unique(self._rows.time_ns)
        direction = self._rows.names["direction"]
        self._sides = [np.flatnonzero(direction.is_one_of([name])) for name in DIRECTIONS]
        self._slots = [np.searchsorted(self._time_ns, self._rows.time_ns[s]) for s in self._sides]

    def check(self, problems: RowProblems) -> None:
        for side in self._sides:
            step_ns, later = np.diff(self._rows.time_ns[side]), self._of_bearing[side[1:]]
            problems.add_rows(later[step_ns == 0], "the same time twice")
            problems.add_rows(later[step_ns < 0], "earlier than the row before")
        for key in PER_BEARING:
            x, y = self._both(self._rows.numbers[key])
            self._check_agreement(key, ~((x == y) | np.isnan(x) & np.isnan(y)), problems)
        if "state" in self._rows.names:
            x, y = self._both(self._rows.states())
            self._check_agreement("state", x != y, problems)

    def merged(self) -> BearingRows:
        numbers = self._rows.numbers
        k_n_per_m, u_random = (self._both(numbers[key]) for key in STIFFNESS)
        shaft, bearing = (self._both(numbers[key]) for key in AMPLITUDES)
        evidence = np.nan_to_num(self._both(self._rows.evidence()), nan=ReadingOutcome.BAD_QUALITY)
        is_measured = evidence == ReadingOutcome.MEASURED
        history = StiffnessHistory(
            time_ns=self._time_ns,
            ln_k=np.log(np.where(is_measured, k_n_per_m, np.nan)),
            u_random=np.where(is_measured, u_random, np.nan),
            shaft_um_pk=shaft,
            bearing_um_pk=bearing,
            outcome=evidence.astype(np.int8),
            **{key: self._either(numbers[key]) for key in PER_BEARING},
        )
        has_state = "state" in self._rows.names
        state = self._either(self._rows.states()).astype(np.int8) if has_state else None
        x, y = self._sides
        return BearingRows(history, state, (x.size, y.size))

    def _both(self, column: FloatArray) -> FloatArray:
        """(2, n) of each direction; NaN where it has no row."""
        found = np.full((2, self._time_ns.size), np.nan)
        for row, (side, slot) in enumerate(zip(self._sides, self._slots, strict=True)):
            found[row, slot] = column[side]
        return found

    def _either(self, column: FloatArray) -> FloatArray:
        """(n,) of the direction that has a row."""
        found = np.full(self._time_ns.size, np.nan)
        for side, slot in zip(self._sides, self._slots, strict=True):
            found[slot] = column[side]
        return found

    def _check_agreement(
        self, key: str, differs: npt.NDArray[np.bool_], problems: RowProblems
    ) -> None:
        """Note where both directions have a row, and the rows differ."""
        in_both = np.isin(self._slots[1], self._slots[0])
        is_wrong = in_both & differs[self._slots[1]]
        rows = self._of_bearing[self._sides[1][is_wrong]]
        problems.add_rows(rows, f"{key} differs from that of direction x")
