"""Problems of rows, collected so that one refusal names many of them."""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from core.arrays import TimeArray

MAX_NAMED = 10
"""Rows that a refusal names."""

MAX_SHOWN = 40
"""Characters of a wrong value that are shown."""


class RowProblems:
    """Problems by row; only as many are kept as a refusal names.

    Parameters
    ----------
    line : (n,)
        Number of each row in messages.
    word
        What `line` counts: "line" or "row".
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
        """Add a problem of some rows, given by mask or number, with the value in each row."""
        rows = np.flatnonzero(wrong) if wrong.dtype == np.bool_ else wrong
        self._n_found += rows.size
        lines = self._line[rows]
        for n in np.argsort(lines, kind="stable")[:MAX_NAMED]:
            words = text if value is None else f"{text} {shown(value(int(rows[n])))}"
            self._found.append((int(lines[n]), words))

    def refuse(self) -> None:
        """Raise if there is any problem.

        Raises
        ------
        ValueError
            With line numbers.
        """
        if not self._found:
            return
        found = sorted(self._found)[:MAX_NAMED]
        said = [f"{self._word} {line}: {text}" for line, text in found]
        if self._n_found > len(found):
            said.append(f"and {self._n_found - len(found)} more")
        raise ValueError("; ".join(said))


def shown(value: Any) -> str:
    """A wrong value as messages show it."""
    text = repr(value)
    return text if len(text) <= MAX_SHOWN else f"{text[:MAX_SHOWN]}…"
