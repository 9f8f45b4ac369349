"""Columns of tables on their way into plots."""

import math

from service.reports.plots.plot import Values

GN_PER_M = 1e9

DAY_S = 86_400.0


def finite_of(values: Values) -> list[float | None]:
    """The same without what is not a number."""
    return [v if v is not None and math.isfinite(v) else None for v in values]
