"""Sorting rows into one history per bearing."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.history_rows.columns import (
    AMPLITUDES,
    PER_BEARING,
    QUALITIES,
    STATES,
    STIFFNESS,
    Columns,
    Place,
    Rows,
)
from core.history_rows.problems import RowProblems
from core.stiffness_history import DIRECTIONS, CodeArray, Evidence, StiffnessHistory

_Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class BearingRows:
    """Readings of one bearing.

    Parameters
    ----------
    state : (n,)
        Members of `OperatingState`; None if the rows do not say it.
    """

    history: StiffnessHistory
    state: CodeArray | None


def histories_from_columns(
    columns: Columns, places: Collection[Place] | None = None, first_line: int = 2
) -> dict[Place, BearingRows]:
    """Sort rows of many bearings and both directions into histories.

    Parameters
    ----------
    columns
        Those of `REQUIRED`; optionally `state` (a name of `OperatingState`) and the others.
        `quality` is a key of `QUALITIES`, `u_random` relative to the stiffness; NaN where there is
        no number.
    places
        Units and bearings that there are; any, if not given.
    first_line
        Number of the first row in messages.

    Raises
    ------
    ValueError
        If columns are missing, unknown or of unequal length, names are unknown, numbers are
        impossible, rows out of order or there twice, or the two directions of one time disagree on
        what is one for both; with line numbers.
    """
    rows, problems = Rows.of(columns), RowProblems(first_line)
    rows.check(places, problems)
    problems.refuse()
    ids, group = np.unique(
        np.stack([rows.names["unit"], rows.names["bearing"]]), axis=1, return_inverse=True
    )
    bearings = [_Merge(rows, np.flatnonzero(group.reshape(-1) == n)) for n in range(ids.shape[1])]
    for bearing in bearings:
        bearing.check(problems)
    problems.refuse()
    return {
        (unit, name): bearing.merged()
        for (unit, name), bearing in zip(ids.T.tolist(), bearings, strict=True)
    }


class _Merge:
    """Rows of one bearing, and where each direction's rows lie on the common axis of time."""

    def __init__(self, rows: Rows, of_bearing: _Ints) -> None:
        self._rows = rows
        self._time_ns = np.unique(rows.time_ns[of_bearing])
        direction = rows.names["direction"][of_bearing]
        self._sides = [of_bearing[direction == name] for name in DIRECTIONS]
        self._slots = [np.searchsorted(self._time_ns, rows.time_ns[s]) for s in self._sides]

    def check(self, problems: RowProblems) -> None:
        for side in self._sides:
            step_ns = np.diff(self._rows.time_ns[side])
            problems.add_rows(side[1:][step_ns == 0], "the same time twice")
            problems.add_rows(side[1:][step_ns < 0], "earlier than the row before")
        for key in PER_BEARING:
            x, y = self._both(self._rows.numbers[key])
            self._check_agreement(key, ~((x == y) | np.isnan(x) & np.isnan(y)), problems)
        if "state" in self._rows.names:
            x, y = self._both(self._states())
            self._check_agreement("state", x != y, problems)

    def merged(self) -> BearingRows:
        numbers = self._rows.numbers
        k_n_per_m, u_random = (self._both(numbers[key]) for key in STIFFNESS)
        shaft, bearing = (self._both(numbers[key]) for key in AMPLITUDES)
        codes = np.array([QUALITIES[name] for name in self._rows.names["quality"].tolist()])
        evidence = self._both(codes.astype(np.float64))
        evidence = np.nan_to_num(evidence, nan=Evidence.BAD_QUALITY)
        is_measured = evidence == Evidence.MEASURED
        history = StiffnessHistory(
            time_ns=self._time_ns,
            ln_k=np.log(np.where(is_measured, k_n_per_m, np.nan)),
            u_random=np.where(is_measured, u_random, np.nan),
            shaft_um_pk=shaft,
            bearing_um_pk=bearing,
            evidence=evidence.astype(np.int8),
            **{key: self._either(numbers[key]) for key in PER_BEARING},
        )
        has_state = "state" in self._rows.names
        return BearingRows(
            history, self._either(self._states()).astype(np.int8) if has_state else None
        )

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

    def _states(self) -> FloatArray:
        return np.array([STATES[name] for name in self._rows.names["state"].tolist()], np.float64)

    def _check_agreement(
        self, key: str, differs: npt.NDArray[np.bool_], problems: RowProblems
    ) -> None:
        """Note where both directions have a row, and the rows differ."""
        in_both = np.isin(self._slots[1], self._slots[0])
        is_wrong = in_both & differs[self._slots[1]]
        problems.add_rows(self._sides[1][is_wrong], f"{key} differs from that of direction x")
