"""Levels over a whole history: what `LevelTimer` says step by step."""

import numpy as np
import numpy.typing as npt

_Bools = npt.NDArray[np.bool_]


def level_history(
    is_passed: _Bools, is_held: _Bools, n_on: int, n_off: int, is_latching: bool
) -> _Bools:
    """(n,) whether a level is active after each judged reading.

    Parameters
    ----------
    is_passed, is_held : (n,)
        Whether the limit is passed, and whether it still is with its deadband.
    n_on, n_off
        Readings in a row that switch the level on, or off.
    """
    switched_on = _in_a_row(is_passed) >= n_on
    switched_off = (_in_a_row(~is_held) >= n_off) & ~switched_on & (not is_latching)
    return last_row(switched_on) > last_row(switched_off)


def last_row(happens: _Bools) -> npt.NDArray[np.int64]:
    """(n,) row in which something happened last; -1 if it has not."""
    rows = np.where(happens, np.arange(happens.size), -1)
    return np.maximum.accumulate(rows) if rows.size else rows


def _in_a_row(happens: _Bools) -> npt.NDArray[np.int64]:
    """(n,) for how many readings it has happened without interruption."""
    return np.arange(happens.size) - last_row(~happens)
