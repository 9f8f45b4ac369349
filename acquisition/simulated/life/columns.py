"""Some rows of columns that belong together."""

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

T = TypeVar("T")
Column: TypeAlias = npt.NDArray[Any]
"""Numbers, or codes, with as many as there are rows along its last axis."""


def rows_of(columns: T, rows: npt.NDArray[np.bool_]) -> T:
    """Some rows of all arrays in a dataclass that have as many.

    Parameters
    ----------
    rows : (n,)
        Wanted rows. Arrays whose last axis is not n long are the same for all and stay.
    """
    return _mapped(columns, rows.size, lambda value: value[..., rows])


def row_between(columns: T, n: int, row: int, share: float) -> T:
    """One row that lies between two, as columns of one row.

    Parameters
    ----------
    n
        Number of rows that there are.
    share
        Of the way from `row` to the next one; 0 is `row` itself. What is counted or coded is that
        of `row`.
    """

    def between(value: Column) -> Column:
        here, there = value[..., row : row + 1], value[..., row + 1 : row + 2]
        if share == 0.0 or not np.issubdtype(value.dtype, np.inexact):
            return here
        return np.asarray((1.0 - share) * here + share * there)

    return _mapped(columns, n, between)


def _mapped(columns: T, n: int, change: Callable[[Column], Column]) -> T:
    if not is_dataclass(columns) or isinstance(columns, type):
        raise TypeError(f"{type(columns).__name__} has no columns")
    chosen = {}
    for field in fields(columns):
        value = getattr(columns, field.name)
        if isinstance(value, np.ndarray) and value.shape[-1] == n:
            value = change(value)
        chosen[field.name] = value
    return type(columns)(**chosen)
