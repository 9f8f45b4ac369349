"""`Members`: the readings of a cell that a baseline stands on."""

from dataclasses import dataclass

import numpy as np

from core.baseline.baseline import BearingBaseline
from core.baseline.history import StiffnessHistory
from core.change.settings import FilmRules
from core.condition.cells import Cell
from core.units import NS_PER_S
from service.reports.described import cell_bounds
from service.reports.parts import AXES, Direction, MembersPart, rounded
from service.store.film_readings import FilmQuery
from service.store.films import FilmStore
from service.store.port import ValueRange

MAX_MEMBERS = 2000


@dataclass(frozen=True)
class Members:
    """All settled readings of a cell in the learning period, both directions."""

    history: StiffnessHistory

    def part(self, direction: Direction) -> MembersPart:
        """Those of one direction, spread evenly if they are many."""
        row, found = AXES.index(direction), self.history
        measured = np.flatnonzero(np.isfinite(found.ln_k[row]))
        step = max(1, -(-measured.size // MAX_MEMBERS))
        rows = measured[::step]
        columns = (
            found.time_ns[rows] / NS_PER_S,
            np.exp(found.ln_k[row, rows]),
            found.u_random[row, rows],
            found.eccentricity_ratio[rows],
            found.oil_temperature_c[rows],
        )
        time, *others = (column.tolist() for column in columns)
        stiffness, u_random, e, oil_c = ([rounded(each) for each in column] for column in others)
        return MembersPart(
            n_in_all=int(measured.size),
            time=time,
            stiffness_n_per_m=stiffness,
            u_random=u_random,
            eccentricity_ratio=e,
            oil_temperature_c=oil_c,
        )


def members_of(
    store: FilmStore, cell: Cell, baseline: BearingBaseline, rules: FilmRules
) -> Members:
    """Read the members of a cell.

    Raises
    ------
    StoreError
        If the store cannot be read.
    """
    origin = baseline.origin
    eccentricity, oil_c, *_ = cell_bounds(cell, rules.grid) or [(0.0, 0.0)] * 2
    query = FilmQuery(
        origin.unit,
        origin.bearing,
        rules.estimators[origin.bearing],
        baseline.learned_from_ns,
        baseline.learned_until_ns + 1,
        eccentricity_ratio=ValueRange(*eccentricity),
        oil_temperature_c=ValueRange(*oil_c),
    )
    found = store.history(query)
    history = found.history
    conditions = history.conditions
    in_cell = np.ones(len(history), np.bool_)
    if len(history):
        wanted = np.array(cell)[:, np.newaxis]
        in_cell = rules.grid.is_known(conditions)
        in_cell &= np.all(rules.grid.cells(conditions) == wanted, axis=0)
    is_healthy = found.is_settled & ~np.any(found.level > 0, axis=0)
    return Members(history.where(in_cell & is_healthy))
