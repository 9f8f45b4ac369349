"""Whether two baselines of a bearing say the same where both know something."""

import numpy as np

from core.baseline.baseline import BearingBaseline
from core.baseline.cell_table import Support

Place = tuple[str, str]


def mean_difference(first: BearingBaseline, second: BearingBaseline) -> dict[Place, float]:
    """Mean difference of ln, second less first, in the cells that both support by themselves.

    Returns
    -------
    By quantity and direction; weighted by readings of the first. One without a common cell is left
    out: nothing is known of how it differs.
    """
    found: dict[Place, float] = {}
    for one in first.quantities:
        other = second.of(one.quantity, one.direction)
        if other is None or other.grid != one.grid:
            continue
        known = {cell.cell for cell in other.table.cells if cell.support is Support.OWN}
        rows = [
            row
            for row, cell in enumerate(one.table.cells)
            if cell.support is Support.OWN and cell.cell in known
        ]
        if rows:
            conditions = one.table.middle.rows(np.array(rows))
            weight = np.array([one.table.cells[row].n_readings for row in rows], np.float64)
            difference = other.surface.at(conditions) - one.surface.at(conditions)
            found[one.quantity, one.direction] = float(np.average(difference, weights=weight))
    return found
