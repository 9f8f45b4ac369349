"""Alarms out of decisions: stretches of readings in which a level is held."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from core.change.backtest import DecisionHistory
from core.limits import AlarmLevel


@dataclass(frozen=True)
class Change:
    """A mean deviation, as it was found at one reading.

    Parameters
    ----------
    row
        Of the decision.
    change, std
        ln of what was measured over what was learned, and the standard uncertainty of its mean.
    """

    row: int
    change: float
    std: float
    time_scale_h: float


@dataclass(frozen=True)
class AlarmStretch:
    """An alarm; rows are those of the decision.

    Parameters
    ----------
    end
        First row without it; None if it lasts.
    level
        The highest that it reached.
    danger
        First row of danger, if it came to that.
    raised, largest
        Change when it was raised, and the largest while it lasted.
    """

    begin: int
    end: int | None
    level: AlarmLevel
    danger: int | None
    raised: Change
    largest: Change


def alarm_stretches(decided: DecisionHistory) -> Iterator[AlarmStretch]:
    """Find all alarms, in order of time."""
    is_active = np.concatenate([[False], decided.level > 0, [False]])
    edges = np.flatnonzero(np.diff(is_active.astype(np.int8)))
    for begin, end in edges.reshape(-1, 2).tolist():
        level = decided.level[begin:end]
        dangers = np.flatnonzero(level == AlarmLevel.DANGER)
        largest = begin + int(np.nanargmax(np.abs(decided.change[begin:end])))
        yield AlarmStretch(
            begin=begin,
            end=end if end < decided.level.size else None,
            level=AlarmLevel(int(level.max())),
            danger=begin + int(dangers[0]) if dangers.size else None,
            raised=_change(decided, begin),
            largest=_change(decided, largest),
        )


def _change(decided: DecisionHistory, row: int) -> Change:
    change = float(decided.change[row])
    significance = float(decided.significance[row])
    return Change(row, change, abs(change) / significance, float(decided.time_scale_h[row]))
