"""Cells: readings of one short span under one condition, summed up."""

from dataclasses import dataclass, fields

import numpy as np

from core.arrays import FloatArray
from core.condition.cells import CellGrid
from service.store.summaries import IntArray, Summaries

NO_STATE = -1
NO_BIN = np.iinfo(np.int64).min
GRID = CellGrid()
"""How fine conditions are told apart in roll-ups; a filter may cut through a cell all the same."""


@dataclass(frozen=True)
class Conditions:
    """Under which conditions readings were taken.

    Parameters
    ----------
    state : (n,)
        Operating state, `NO_STATE` where it is not known.
    n_readings : (n,)
        How many, usable or not.
    eccentricity_low, eccentricity_high, oil_low_c, oil_high_c : (n,)
        Extremes, NaN where they are not known.
    """

    state: IntArray
    n_readings: IntArray
    eccentricity_low: FloatArray
    eccentricity_high: FloatArray
    oil_low_c: FloatArray
    oil_high_c: FloatArray

    @classmethod
    def of(cls, state: IntArray, eccentricity: FloatArray, oil_c: FloatArray) -> "Conditions":
        """Of single readings."""
        one = np.ones(state.size, dtype=np.int64)
        return cls(state, one, eccentricity, eccentricity, oil_c, oil_c)

    def summed(self, order: IntArray, starts: IntArray) -> "Conditions":
        """One for each run of rows of an order; all rows of a run are of one cell."""
        return Conditions(
            self.state[order][starts],
            np.add.reduceat(self.n_readings[order], starts),
            np.fmin.reduceat(self.eccentricity_low[order], starts),
            np.fmax.reduceat(self.eccentricity_high[order], starts),
            np.fmin.reduceat(self.oil_low_c[order], starts),
            np.fmax.reduceat(self.oil_high_c[order], starts),
        )


@dataclass(frozen=True)
class Cells:
    """Summaries of readings with the conditions that they were taken under, in order of time."""

    conditions: Conditions
    summaries: Summaries

    def gathered(self, width_ns: int) -> "Cells":
        """The same in spans of this width: one for each condition of each span."""
        bucket = self.summaries.time_ns // width_ns
        keys = np.stack(
            [
                bins(self.conditions.oil_low_c, GRID.temperature_width_c),
                bins(self.conditions.eccentricity_low, GRID.eccentricity_width),
                self.conditions.state,
                bucket,
            ]
        )
        order = np.lexsort(keys)  # stable: in order of time within a cell
        is_first = np.any(np.diff(keys[:, order], axis=1) != 0, axis=0)
        starts = np.flatnonzero(np.concatenate([[True], is_first]))
        times = bucket[order][starts] * width_ns
        return Cells(
            self.conditions.summed(order, starts), self.summaries.at(order).summed(starts, times)
        )

    def slots(self) -> IntArray:
        """Number of each cell within its span."""
        time_ns = self.summaries.time_ns
        first = np.flatnonzero(np.concatenate([[True], np.diff(time_ns) != 0]))
        lengths = np.diff(np.append(first, time_ns.size))
        return np.arange(time_ns.size) - np.repeat(first, lengths)


def together(one: Cells, other: Cells) -> Cells:
    """Cells of both, the one's first: to be gathered, which puts them in order."""
    conditions = Conditions(
        *(
            np.concatenate([getattr(one.conditions, name), getattr(other.conditions, name)])
            for name in (field.name for field in fields(Conditions))
        )
    )
    return Cells(conditions, one.summaries.followed_by(other.summaries))


def bins(value: FloatArray, width: float) -> IntArray:
    """Bin of each value, with bounds as people write them; `NO_BIN` where there is no value."""
    known = np.isfinite(value)
    safe = np.clip(np.where(known, value, 0.0), -1e9, 1e9)
    number = np.floor(safe / width).astype(np.int64)
    number += safe >= np.round((number + 1) * width, 9)
    number -= safe < np.round(number * width, 9)
    return np.where(known, number, NO_BIN)
