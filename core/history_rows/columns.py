"""Which columns rows of readings have, and what may stand in them."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.condition.operating_state import OperatingState
from core.history_rows.problems import RowProblems
from core.stiffness_history import DIRECTIONS, Evidence, TimeArray

Columns: TypeAlias = Mapping[str, Sequence[Any] | npt.NDArray[Any]]
NameArray: TypeAlias = npt.NDArray[np.str_]
Place: TypeAlias = tuple[str, str]
"""Unit and bearing."""

NAMES = ("unit", "bearing", "direction", "quality")
STIFFNESS = ("k_n_per_m", "u_random")
PER_BEARING = (
    *("eccentricity_ratio", "oil_temperature_c", "speed_rpm", "power_mw"),
    *("u_eccentricity", "attitude_deg"),
)
"""Columns that are one for both directions."""

AMPLITUDES = ("shaft_um_pk", "bearing_um_pk")
REQUIRED = ("time_ns", *NAMES, *STIFFNESS, "eccentricity_ratio", "oil_temperature_c")
"""Columns without which there is no history; of the others, missing ones are NaN."""

KNOWN = frozenset({*REQUIRED, *PER_BEARING, *AMPLITUDES, "state"})

QUALITIES = {
    "good": Evidence.MEASURED,
    "uncertain": Evidence.BAD_QUALITY,
    "bad": Evidence.BAD_QUALITY,
    Evidence.INSUFFICIENT_EXCITATION.name.lower(): Evidence.INSUFFICIENT_EXCITATION,
}
"""What a reading's quality makes of it: what is uncertain is neither learned nor judged."""

STATES = {state.name.lower(): state for state in OperatingState}


@dataclass(frozen=True, eq=False)
class Rows:
    """Columns of rows, all of one length.

    Parameters
    ----------
    names
        Of `NAMES`, and `state` where rows say it.
    numbers
        All of `STIFFNESS`, `PER_BEARING` and `AMPLITUDES`.
    """

    time_ns: TimeArray
    names: Mapping[str, NameArray]
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
            {key: np.asarray(columns[key], np.str_) for key in (*NAMES, "state") if key in columns},
            {
                key: np.asarray(columns.get(key, nothing), np.float64)
                for key in (*STIFFNESS, *PER_BEARING, *AMPLITUDES)
            },
        )

    def check(self, places: Collection[Place] | None, problems: RowProblems) -> None:
        """Note names that are not known and numbers that cannot be."""
        for key, known in (("direction", DIRECTIONS), ("quality", QUALITIES), ("state", STATES)):
            if key in self.names:
                is_wrong = ~np.isin(self.names[key], list(known))
                problems.add_values(is_wrong, f"unknown {key}", self.names[key])
        if places is not None:
            self._check_places(places, problems)
        is_measured = self.names["quality"] == "good"
        for key in STIFFNESS:
            is_wrong = is_measured & ~(self.numbers[key] > 0.0)
            problems.add_values(is_wrong, f"{key} must be above 0, not", self.numbers[key])
        for key, column in self.numbers.items():
            problems.add_values(np.isinf(column), f"{key} must be finite, not", column)

    def _check_places(self, places: Collection[Place], problems: RowProblems) -> None:
        unit, bearing = self.names["unit"], self.names["bearing"]
        units = sorted({unit for unit, _ in places})
        problems.add_values(~np.isin(unit, units), "unknown unit", unit)
        for name in units:
            bearings = [b for u, b in places if u == name]
            is_wrong = (unit == name) & ~np.isin(bearing, bearings)
            problems.add_values(is_wrong, f"unit {name} has no bearing", bearing)


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
