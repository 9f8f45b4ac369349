"""What is wrong with rows, gathered so that all of it can be said at once."""

import numpy as np
import numpy.typing as npt

from core.stiffness_history import TimeArray

MOST_NAMED = 10
"""Rows that a refusal names."""


class RowProblems:
    """Gathers problems by row.

    Parameters
    ----------
    first_line
        Number of the first row in messages.
    """

    def __init__(self, first_line: int) -> None:
        self._first_line = first_line
        self._found: list[tuple[int, str]] = []

    def add(self, is_wrong: npt.NDArray[np.bool_], text: str) -> None:
        """Note a problem of every row where the mask says so."""
        self.add_rows(np.flatnonzero(is_wrong), text)

    def add_rows(self, rows: TimeArray, text: str) -> None:
        """Note a problem of some rows."""
        self._found += [(int(row), text) for row in rows]

    def add_values(
        self, is_wrong: npt.NDArray[np.bool_], text: str, values: npt.NDArray[np.generic]
    ) -> None:
        """Note a problem of every row where the mask says so, with the value."""
        rows = np.flatnonzero(is_wrong)
        self._found += [(int(row), f"{text} {values[row].item()!r}") for row in rows]

    def refuse(self) -> None:
        """Raise if anything is wrong.

        Raises
        ------
        ValueError
            With line numbers.
        """
        if not self._found:
            return
        found = sorted(self._found)
        said = [f"line {row + self._first_line}: {text}" for row, text in found[:MOST_NAMED]]
        if len(found) > MOST_NAMED:
            said.append(f"and {len(found) - MOST_NAMED} more")
        raise ValueError("; ".join(said))
