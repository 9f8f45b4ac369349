"""What is wrong with rows, gathered so that all of it can be said at once."""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from core.arrays import TimeArray

MOST_NAMED = 10
"""Rows that a refusal names."""

MOST_SHOWN = 40
"""Characters of a wrong value that are shown."""


class RowProblems:
    """Gathers problems by row; remembers only as many as a refusal names.

    Parameters
    ----------
    line : (n,)
        Number of each row in messages.
    word
        What such a number counts: lines or rows.
    """

    def __init__(self, line: TimeArray, word: str = "line") -> None:
        self._line, self._word = line, word
        self._found: list[tuple[int, str]] = []
        self._n_found = 0

    def add(self, is_wrong: npt.NDArray[np.bool_], text: str) -> None:
        """Note a problem of every row where the mask says so."""
        self._add(np.flatnonzero(is_wrong), lambda _: text)

    def add_rows(self, rows: TimeArray, text: str) -> None:
        """Note a problem of some rows."""
        self._add(rows, lambda _: text)

    def add_values(
        self, is_wrong: npt.NDArray[np.bool_], text: str, value: Callable[[int], Any]
    ) -> None:
        """Note a problem of every row where the mask says so, with the value in the row."""
        self._add(np.flatnonzero(is_wrong), lambda row: f"{text} {shown(value(row))}")

    def refuse(self) -> None:
        """Raise if anything is wrong.

        Raises
        ------
        ValueError
            With line numbers.
        """
        if not self._found:
            return
        found = sorted(self._found)[:MOST_NAMED]
        said = [f"{self._word} {line}: {text}" for line, text in found]
        if self._n_found > len(found):
            said.append(f"and {self._n_found - len(found)} more")
        raise ValueError("; ".join(said))

    def _add(self, rows: TimeArray, text: Callable[[int], str]) -> None:
        self._n_found += rows.size
        lines = self._line[rows]
        first = np.argsort(lines, kind="stable")[:MOST_NAMED]
        self._found += [(int(lines[n]), text(int(rows[n]))) for n in first]


def shown(value: Any) -> str:
    """A wrong value as messages show it."""
    text = repr(value)
    return text if len(text) <= MOST_SHOWN else f"{text[:MOST_SHOWN]}…"
