"""Which combinations of a parametrised family run in the fast tier; see docs/reference/tests.md."""

from collections.abc import Iterable, Sequence
from typing import Any

import pytest


def covering(*axes: Sequence[Any]) -> list[Any]:
    """Full product of some axes, of which a covering set stays in the fast tier.

    In the covering set every value of every axis occurs at least once: row i holds the value
    i modulo its length of each axis. All other combinations belong to the long tier. Axes may
    hold `pytest.param` values; their ids are kept, and one marked long takes its whole
    combination to the long tier.

    Examples
    --------
    ``parametrize(("kind", "wire"), covering(KINDS, WIRES))``
    """
    n_rows = max(len(axis) for axis in axes)
    fast = {tuple(row % len(axis) for axis in axes) for row in range(n_rows)}
    positions: list[tuple[int, ...]] = [()]
    for axis in axes:
        positions = [(*row, i) for row in positions for i in range(len(axis))]
    return [_row(axes, position, position in fast) for position in positions]


def first_fast(n: int, values: Iterable[Any]) -> list[Any]:
    """Values of a family: the first `n` for the fast tier, all others for the long tier."""
    long = pytest.mark.long
    return [v if i < n else pytest.param(v, marks=long) for i, v in enumerate(values)]


def _row(axes: Sequence[Sequence[Any]], position: tuple[int, ...], is_fast: bool) -> Any:
    given = [_param(axis[i]) for axis, i in zip(axes, position, strict=True)]
    marks = [mark for param in given for mark in param.marks]
    if not is_fast and not any(mark.name == "torture" for mark in marks):
        marks.append(pytest.mark.long)
    values = [value for param in given for value in param.values]
    names = (param.id or str(i) for param, i in zip(given, position, strict=True))
    return pytest.param(*values, marks=marks, id="-".join(map(str, names)))


def _param(value: Any) -> Any:
    """A value as `pytest.param`, named as pytest names it where it can."""
    if isinstance(value, type(pytest.param())):
        return value
    name = value if isinstance(value, str) else getattr(value, "__name__", None)
    return pytest.param(value, id=name)
