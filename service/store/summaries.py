"""Readings summed up: for each quantity count, mean, extremes and worst quality."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray

IntArray = npt.NDArray[np.int64]
LevelArray = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Summaries:
    """Summaries of readings, a row for each time and a column for each quantity.

    Parameters
    ----------
    names
        Of the columns.
    time_ns : (n,)
        When the readings were taken, or from when on.
    count, mean, minimum, maximum, level : (n, n_names)
        Usable readings, and the worst quality of all; where none was usable the numbers are NaN.
    """

    names: tuple[str, ...]
    time_ns: IntArray
    count: IntArray
    mean: FloatArray
    minimum: FloatArray
    maximum: FloatArray
    level: LevelArray

    @classmethod
    def of(
        cls, names: tuple[str, ...], time_ns: IntArray, value: FloatArray, level: LevelArray
    ) -> "Summaries":
        """Every reading its own summary; values NaN where there is none."""
        count = np.isfinite(value).astype(np.int64)
        return cls(names, time_ns, count, value, value, value, level)

    @classmethod
    def together(cls, parts: list["Summaries"]) -> "Summaries":
        """All of some, at least one, in order of time."""
        time_ns = np.concatenate([part.time_ns for part in parts])
        order = np.argsort(time_ns, kind="stable")
        return cls(
            parts[0].names,
            time_ns[order],
            np.concatenate([part.count for part in parts])[order],
            np.concatenate([part.mean for part in parts])[order],
            np.concatenate([part.minimum for part in parts])[order],
            np.concatenate([part.maximum for part in parts])[order],
            np.concatenate([part.level for part in parts])[order],
        )

    def followed_by(self, other: "Summaries") -> "Summaries":
        """All rows of this one, then those of another with the same columns."""
        return Summaries(
            self.names,
            np.concatenate([self.time_ns, other.time_ns]),
            np.concatenate([self.count, other.count]),
            np.concatenate([self.mean, other.mean]),
            np.concatenate([self.minimum, other.minimum]),
            np.concatenate([self.maximum, other.maximum]),
            np.concatenate([self.level, other.level]),
        )

    def at(self, rows: IntArray | npt.NDArray[np.bool_]) -> "Summaries":
        """Some rows, in the order given."""
        return Summaries(
            self.names,
            self.time_ns[rows],
            self.count[rows],
            self.mean[rows],
            self.minimum[rows],
            self.maximum[rows],
            self.level[rows],
        )

    def only(self, names: tuple[str, ...]) -> "Summaries":
        """Some columns, in the order given."""
        columns = [self.names.index(name) for name in names]
        return Summaries(
            names,
            self.time_ns,
            self.count[:, columns],
            self.mean[:, columns],
            self.minimum[:, columns],
            self.maximum[:, columns],
            self.level[:, columns],
        )

    def in_spans(self, width_ns: int) -> "Summaries":
        """One summary for each aligned span of this width that has any, of rows in order."""
        if self.time_ns.size == 0:
            return self
        number = self.time_ns // width_ns
        starts = np.flatnonzero(np.diff(number, prepend=number[0] - 1))
        return self.summed(starts, number[starts] * width_ns)

    def summed(self, starts: IntArray, time_ns: IntArray) -> "Summaries":
        """One summary for each run of rows.

        Parameters
        ----------
        starts : (m,)
            First row of each run.
        time_ns : (m,)
            What is to stand for their times.
        """
        count = np.add.reduceat(self.count, starts, axis=0)
        weighed = np.where(self.count > 0, self.mean * np.maximum(self.count, 1), 0.0)
        total = np.add.reduceat(weighed, starts, axis=0)
        mean = np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)
        lowest = np.fmin.reduceat(self.minimum, starts, axis=0)
        highest = np.fmax.reduceat(self.maximum, starts, axis=0)
        mean = np.clip(mean, lowest, highest)  # rounding may carry a mean past equal values
        level = np.maximum.reduceat(self.level, starts, axis=0)
        return Summaries(self.names, time_ns, count, mean, lowest, highest, level)
