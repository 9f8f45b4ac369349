"""Which columns rows of readings have, and what may stand in them."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray, TimeArray
from core.baseline.history import DIRECTIONS, ReadingOutcome
from core.baseline.history_rows.names import Names
from core.baseline.history_rows.problems import RowProblems
from core.condition.operating_state import OperatingState
from core.quality import Reason

Columns: TypeAlias = Mapping[str, Names | Sequence[Any] | npt.NDArray[Any]]
Place: TypeAlias = tuple[str, str]
"""Unit and bearing."""

NAMES = ("unit", "bearing", "direction", "quality")
OPTIONAL_NAMES = ("state", "reason")
STIFFNESS = ("k_n_per_m", "u_random")
PER_BEARING = (
    *("eccentricity_ratio", "oil_temperature_c", "speed_rpm", "power_mw"),
    *("u_eccentricity", "attitude_deg"),
)
"""Columns that are one for both directions."""

AMPLITUDES = ("shaft_um_pk", "bearing_um_pk")
NUMBERS = (*STIFFNESS, *PER_BEARING, *AMPLITUDES)
REQUIRED = ("time_ns", *NAMES, *STIFFNESS, "eccentricity_ratio", "oil_temperature_c")
"""Columns without which there is no history; of the others, missing ones are NaN."""

KNOWN = frozenset({*REQUIRED, *NUMBERS, *OPTIONAL_NAMES})

SILENT = ReadingOutcome.INSUFFICIENT_EXCITATION.name.lower()
QUALITIES = {
    "good": ReadingOutcome.MEASURED,
    "uncertain": ReadingOutcome.BAD_QUALITY,
    "bad": ReadingOutcome.BAD_QUALITY,
    SILENT: ReadingOutcome.INSUFFICIENT_EXCITATION,
}
"""What a reading's quality makes of it: what is uncertain is neither learned nor judged."""

REASONS = frozenset(reason.value for reason in Reason)
STATES = {state.name.lower(): state for state in OperatingState}

_KNOWN_NAMES: tuple[tuple[str, Collection[str]], ...] = (
    *(("direction", DIRECTIONS), ("quality", QUALITIES)),
    *(("state", STATES), ("reason", REASONS)),
)
_UNSIGNED = (*AMPLITUDES, "eccentricity_ratio", "u_eccentricity")


@dataclass(frozen=True, eq=False)
class Rows:
    """Columns of rows, all of one length.

    Parameters
    ----------
    names
        Of `NAMES`, and those of `OPTIONAL_NAMES` that rows have.
    numbers
        All of `NUMBERS`.
    """

    time_ns: TimeArray
    names: Mapping[str, Names]
    numbers: Mapping[str, FloatArray]

    @classmethod
    def of(cls, columns: Columns) -> "Rows":
        """Take columns over.

        Raises
        ------
        ValueError
            If one is missing, unknown, of another length than the others, or not numbers.
        """
        _check_columns(columns)
        time_ns = np.asarray(columns["time_ns"], np.int64)
        nothing = np.full(time_ns.size, np.nan)
        return cls(
            time_ns,
            {key: Names.of(columns[key]) for key in (*NAMES, *OPTIONAL_NAMES) if key in columns},
            {key: np.asarray(columns.get(key, nothing), np.float64) for key in NUMBERS},
        )

    def rows(self, wanted: npt.NDArray[np.int64]) -> "Rows":
        """Some of the rows."""
        return Rows(
            self.time_ns[wanted],
            {key: column.rows(wanted) for key, column in self.names.items()},
            {key: column[wanted] for key, column in self.numbers.items()},
        )

    def evidence(self) -> FloatArray:
        """(n,) members of `ReadingOutcome`, as numbers that can be NaN."""
        found = (
            self.names["quality"].mapped(QUALITIES, ReadingOutcome.BAD_QUALITY).astype(np.float64)
        )
        if "reason" in self.names:
            is_silent = self.names["quality"].is_one_of(["bad"])
            is_silent &= self.names["reason"].is_one_of([SILENT])
            found[is_silent] = ReadingOutcome.INSUFFICIENT_EXCITATION
        return found

    def states(self) -> FloatArray:
        """(n,) members of `OperatingState`, as numbers that can be NaN."""
        return self.names["state"].mapped(STATES, OperatingState.UNKNOWN).astype(np.float64)

    def check(self, places: Collection[Place] | None, problems: RowProblems) -> None:
        """Note names that are not known and numbers that cannot be."""
        for key, known in _KNOWN_NAMES:
            if key in self.names:
                wrong = self.names[key].is_none_of(known)
                problems.add_values(wrong, f"unknown {key}", self._name(key))
        if places is not None:
            self._check_places(places, problems)
        is_good = self.names["quality"].is_one_of(["good"])
        if "reason" in self.names:
            wrong = is_good & self.names["reason"].is_none_of(["ok"])
            problems.add_values(wrong, "quality good for the reason", self._name("reason"))
        self._check_numbers(is_good, problems)

    def _check_numbers(self, is_good: npt.NDArray[np.bool_], problems: RowProblems) -> None:
        for key, column in self.numbers.items():
            if key in STIFFNESS:
                wrong = (is_good & ~(column > 0.0)) | (column <= 0.0)
                problems.add_values(wrong, f"{key} must be above 0, not", column.item)
            if key in _UNSIGNED:
                problems.add_values(column < 0.0, f"{key} must not be below 0:", column.item)
            problems.add_values(np.isinf(column), f"{key} must be finite, not", column.item)

    def _check_places(self, places: Collection[Place], problems: RowProblems) -> None:
        unit, bearing = self.names["unit"], self.names["bearing"]
        units = sorted({unit for unit, _ in places})
        problems.add_values(unit.is_none_of(units), "unknown unit", self._name("unit"))
        for name in units:
            bearings = [b for u, b in places if u == name]
            wrong = unit.is_one_of([name]) & bearing.is_none_of(bearings)
            problems.add_values(wrong, f"unit {name} has no bearing", self._name("bearing"))

    def _name(self, key: str) -> Any:
        column = self.names[key]
        return lambda row: column.names[column.code[row]]


def _check_columns(columns: Columns) -> None:
    missing = [key for key in REQUIRED if key not in columns]
    if missing:
        raise ValueError(f"missing columns: {', '.join(missing)}")
    unknown = sorted(set(columns) - KNOWN)
    if unknown:
        raise ValueError(f"unknown columns: {', '.join(unknown)}")
    lengths = {key: len(column) for key, column in columns.items()}
    if len(set(lengths.values())) > 1:
        raise ValueError(f"columns of unequal length: {lengths}")
