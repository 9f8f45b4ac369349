"""Columns of few names in many rows, as the names and which of them stands in each row."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

_Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Names:
    """A column of names.

    Parameters
    ----------
    names
        Those that there are, each once.
    code : (n,)
        Number of the row's name.
    """

    names: tuple[str, ...]
    code: npt.NDArray[np.int32]

    @classmethod
    def of(cls, column: "Names | Sequence[Any] | npt.NDArray[Any]") -> "Names":
        """Take a column over, coded already or as texts."""
        if isinstance(column, Names):
            return column
        number: dict[str, int] = {}
        code = [number.setdefault(str(name), len(number)) for name in column]
        return cls(tuple(number), np.array(code, np.int32))

    def __len__(self) -> int:
        return int(self.code.size)

    def rows(self, wanted: npt.NDArray[np.int64]) -> "Names":
        """Some of the rows."""
        return Names(self.names, self.code[wanted])

    def is_none_of(self, known: Collection[str]) -> _Bools:
        """(n,) whether a row's name is another one."""
        return self.mapped(dict.fromkeys(known, False), True).astype(np.bool_)

    def is_one_of(self, known: Collection[str]) -> _Bools:
        """(n,) whether a row's name is one of these."""
        return ~self.is_none_of(known)

    def mapped(self, values: dict[str, Any], default: Any) -> npt.NDArray[Any]:
        """(n,) what stands for each row's name."""
        return np.array([values.get(name, default) for name in self.names] or [default])[self.code]
