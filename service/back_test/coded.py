"""Batches of rows gathered into columns, with names as numbers."""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow.compute as pc

from core.baseline.history_rows import Names
from core.baseline.history_rows.problems import shown
from service.back_test.file_columns import LINE, TEXTS, ReadingsError

MAX_NAMES = 2000
"""Of different ones in a column: 200 units of at most 8 bearings."""

IDENTIFIER = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,31}")
"""Of units and bearings, as in plant files."""


class CodedNames:
    """Names of one column, numbered as they come."""

    def __init__(self, key: str, word: str) -> None:
        self._key, self._word = key, word
        self._number: dict[str, int] = {}
        self._codes: list[npt.NDArray[np.int32]] = []

    def add(self, column: Any, line: npt.NDArray[np.int64]) -> None:
        """Take in the names of a batch.

        Raises
        ------
        ReadingsError
            If there are too many different ones, or one cannot be that of a unit or bearing.
        """
        coded = pc.dictionary_encode(column)
        index = coded.indices.to_numpy(zero_copy_only=False)
        names = coded.dictionary.to_pylist()
        for name in names:
            self._check(name, names, index, line)
        code = np.array([self._number.setdefault(n, len(self._number)) for n in names], np.int32)
        if len(self._number) > MAX_NAMES:
            raise ReadingsError(
                f"more than {MAX_NAMES} different names in column {self._key} up to"
                f" {self._word} {line[-1]}"
            )
        self._codes.append(code[index])

    def column(self) -> Names:
        """All of them."""
        return Names(tuple(self._number), np.concatenate(self._codes))

    def _check(self, name: str, names: list[str], index: Any, line: Any) -> None:
        if self._key in ("unit", "bearing") and not IDENTIFIER.fullmatch(name):
            row = int(np.argmax(index == names.index(name)))
            raise ReadingsError(
                f"{self._word} {line[row]}: {self._key} {shown(name)} must be letters, digits, dot,"
                " dash or underscore, at most 32"
            )


class Gathered:
    """Columns of all batches so far."""

    def __init__(self, schema: Any, word: str) -> None:
        self._names = {key: CodedNames(key, word) for key in TEXTS if key in schema.names}
        self._numbers: dict[str, list[Any]] = {
            key: [] for key in schema.names if key not in self._names
        }

    def add(self, batch: Any) -> None:
        """Take in a batch."""
        line = batch.column(LINE).to_numpy()
        for key, names in self._names.items():
            names.add(batch.column(key), line)
        for key, parts in self._numbers.items():
            parts.append(batch.column(key).to_numpy().copy())

    def columns(self) -> Mapping[str, Any]:
        """All of them; what was gathered is given away."""
        found: dict[str, Any] = {key: names.column() for key, names in self._names.items()}
        for key in list(self._numbers):
            found[key] = np.concatenate(self._numbers.pop(key))
        return found
