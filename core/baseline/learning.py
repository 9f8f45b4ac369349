"""Learning a baseline from stored readings, in one go.

In one go and not reading by reading: what is an outlier shows only against all the rest, and the
store keeps every reading anyhow. A year of one bearing takes less than a second and a few
megabytes, whatever came before. Nothing depends on the order of the days, except how alike days
that follow one another are.
"""

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray, TimeArray
from core.baseline.baseline import BearingBaseline, Origin, QuantityBaseline, Watched
from core.baseline.cell_scatter import with_scatter
from core.baseline.fit import Fit, fit_surface, surface_shape
from core.baseline.groups import DAY_NS, Groups, group_readings
from core.baseline.held_out import held_out_deviations
from core.baseline.settings import BaselineSettings
from core.baseline.slope_scatter import LEAST_SCATTER
from core.baseline.stiffness_history import DIRECTIONS, StiffnessHistory
from core.baseline.tabulate import tabulate
from core.baseline.time_scatter import time_scatter
from core.baseline.watched import watched_values
from core.condition.film_conditions import FilmConditions

REJECTED = 0.1
"""Robust weight below which a group counts as rejected."""


def learn(
    history: StiffnessHistory,
    is_settled: npt.NDArray[np.bool_],
    origin: Origin,
    settings: BaselineSettings,
    watched: tuple[Watched, ...] = (Watched.STIFFNESS,),
) -> BearingBaseline:
    """Learn what a bearing is like under each condition.

    Parameters
    ----------
    history
        Readings of the learning period, believed to be healthy for the most part.
    is_settled : (n,)
        Whether the unit had settled in a steady state.
    watched
        Quantities to be learned.

    Raises
    ------
    ValueError
        If the history is empty.
    """
    if not len(history):
        raise ValueError("there are no readings to learn from")
    found = [
        _learn_quantity(history, is_settled, quantity, direction, settings)
        for quantity in watched
        for direction in DIRECTIONS
    ]
    return BearingBaseline(
        origin,
        int(history.time_ns[0]),
        int(history.time_ns[-1]),
        tuple(quantity for quantity in found if quantity is not None),
    )


def _learn_quantity(
    history: StiffnessHistory,
    is_settled: npt.NDArray[np.bool_],
    quantity: Watched,
    direction: str,
    settings: BaselineSettings,
) -> QuantityBaseline | None:
    conditions = history.conditions
    value, u_random = watched_values(history, quantity, direction)
    usable = is_settled & settings.is_known(conditions) & np.isfinite(value)
    time_ns, conditions, value = history.time_ns[usable], conditions.rows(usable), value[usable]
    if value.size == 0:
        return None
    groups = group_readings(time_ns, conditions, value, settings.grid)
    if np.unique(groups.day).size < settings.min_learning_days:
        return None
    return _fitted(
        quantity, direction, settings, time_ns, conditions, value, u_random[usable], groups
    )


def _fitted(
    quantity: Watched,
    direction: str,
    settings: BaselineSettings,
    time_ns: TimeArray,
    conditions: FilmConditions,
    value: FloatArray,
    u_random: FloatArray,
    groups: Groups,
) -> QuantityBaseline:
    grid = settings.grid
    fit = _fit(groups, settings)
    table = tabulate(conditions, value, groups, fit, settings)
    deviation = held_out_deviations(time_ns, conditions, value, groups, fit, table, settings)
    counted = np.isfinite(deviation)
    deviation, place = deviation[counted], table.find(grid.cells(conditions))[counted]
    slope, day = fit.surface.slope(table.middle), time_ns[counted] // DAY_NS
    table = with_scatter(table, slope, place, day, deviation)
    scatter = table.scatter[place]
    return QuantityBaseline(
        quantity=quantity,
        direction=direction,
        grid=grid,
        surface=fit.surface,
        attitude_covariance=fit.attitude_covariance,
        table=table,
        max_surface_std=settings.max_surface_std,
        scatter=float(np.median(scatter)) if scatter.size else LEAST_SCATTER,
        u_random=float(np.median(u_random)),
        reading_h=settings.reading_h,
        time_scatter=time_scatter(deviation, place, table, settings),
        rejected_share=float(np.mean(fit.robust_weight < REJECTED)),
    )


def _fit(groups: Groups, settings: BaselineSettings) -> Fit:
    grid, knots = settings.grid, settings.knot_cells
    shape = surface_shape(
        groups,
        knots * grid.eccentricity_width,
        knots * grid.temperature_width_c,
        settings.has_attitude,
    )
    return fit_surface(groups, shape, settings.bend_std)
