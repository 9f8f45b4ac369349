"""Some rows of columns that belong together."""

from dataclasses import fields, is_dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

T = TypeVar("T")


def rows_of(columns: T, rows: npt.NDArray[np.bool_]) -> T:
    """Some rows of everything in a dataclass that has as many: arrays, and dataclasses of them.

    Parameters
    ----------
    rows : (n,)
        Wanted rows. Arrays whose last axis is not n long are the same for all and stay.
    """
    if not is_dataclass(columns) or isinstance(columns, type):
        raise TypeError(f"{type(columns).__name__} has no columns")
    chosen = {}
    for field in fields(columns):
        value = getattr(columns, field.name)
        if isinstance(value, np.ndarray) and value.shape[-1] == rows.size:
            value = value[..., rows]
        chosen[field.name] = value
    return type(columns)(**chosen)
