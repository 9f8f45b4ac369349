"""`BearingBaseline`: learned film stiffness of a bearing, with its origin."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from core.arrays import BoolArray, FloatArray, IntArray
from core.baseline.cell_table import NODES, CellTable
from core.baseline.grouping import ewma_weight
from core.baseline.history import QUANTITIES, StiffnessHistory
from core.baseline.surface import ATTITUDE_TERMS, Surface, attitude_terms
from core.condition.cells import CellGrid, FilmConditions


@dataclass(frozen=True)
class TimeScatter:
    """Relative scatter of the mean deviation over a time scale, for correlated readings.

    Raises `ValueError` if a value is not above 0.

    Parameters
    ----------
    time_scale_h
        Averaging time in running hours.
    share
        Standard deviation of the mean divided by that of single readings; 1 if fully correlated.
    """

    time_scale_h: float
    share: float

    def __post_init__(self) -> None:
        if not (self.time_scale_h > 0.0 and self.share > 0.0):
            found = f"{self.time_scale_h:g} and {self.share:g}"
            raise ValueError(f"time_scale_h and share must be above 0, got {found}")


@dataclass(frozen=True)
class Origin:
    """Identity of a baseline: unit, bearing, estimator, version, author and time.

    Parameters
    ----------
    version
        Version number of the baseline of this bearing, from 1.
    created_ns
        Host time at which the baseline was learned.
    event
        Event at the machine that required a new baseline; empty if none.
    """

    unit: str
    bearing: str
    estimator: str
    version: int
    author: str
    created_ns: int
    event: str = ""


@dataclass(frozen=True, eq=False)
class Deviations:
    """Deviations of n readings of ln stiffness from their baseline, with standard deviations in ln.

    Parameters
    ----------
    place : (n,)
        Index of the reading's cell in the cell table; -1 if the reading cannot be compared.
    deviation : (n,)
        ln of the measured stiffness over the learned stiffness; invalid where `place` is -1.
    weight : (n,)
        Typical variance of readings divided by the variance of this reading, at most 1.
    scatter : (n,)
        Part of the scatter of readings in the cell that averaging reduces.
    surface_std : (n,)
        Standard uncertainty of the surface at the reading.
    offset_std : (n,)
        Part of the deviation's standard uncertainty that averaging does not reduce, with that of
        the surface.
    """

    place: IntArray
    deviation: FloatArray
    weight: FloatArray
    scatter: FloatArray
    surface_std: FloatArray
    offset_std: FloatArray


@dataclass(frozen=True)
class QuantityBaseline:
    """Learned values of one of the `QUANTITIES` of a film.

    Raises `ValueError` if a value is out of its range, or sizes or order of values are wrong.

    Parameters
    ----------
    quantity
        Name of the quantity, a key of `QUANTITIES`.
    attitude_covariance
        Covariance of the attitude terms of the surface; empty without attitude terms.
    max_surface_std
        Standard uncertainty of the surface, in ln, above which readings are not compared.
    scatter
        Typical standard deviation, in ln, of single readings about the surface over all cells.
    u_random
        Typical random uncertainty of a reading, in ln, which `scatter` includes.
    reading_h
        Interval between readings in running hours.
    time_scatter
        Relative scatter of means over each time scale, the shortest time scale first.
    rejected_share
        Fraction of the learning groups that the robust fit rejected.
    """

    quantity: str
    grid: CellGrid
    surface: Surface
    attitude_covariance: tuple[tuple[float, ...], ...]
    table: CellTable
    max_surface_std: float
    scatter: float
    u_random: float
    reading_h: float
    time_scatter: tuple[TimeScatter, ...]
    rejected_share: float

    def __post_init__(self) -> None:
        if self.quantity not in QUANTITIES:
            known = ", ".join(QUANTITIES)
            raise ValueError(f"quantity must be one of {known}, got {self.quantity}")
        if not (self.scatter > 0.0 and self.u_random >= 0.0 and self.reading_h > 0.0):
            raise ValueError(
                "scatter and reading_h must be above 0 and u_random not below 0, got"
                f" {self.scatter:g}, {self.reading_h:g} and {self.u_random:g}"
            )
        n_terms = ATTITUDE_TERMS if self.surface.shape.has_attitude else 0
        if [len(row) for row in self.attitude_covariance] != [n_terms] * n_terms:
            found = ", ".join(str(len(row)) for row in self.attitude_covariance) or "none"
            wanted = f"{n_terms} rows of length {n_terms}"
            raise ValueError(f"attitude_covariance needs {wanted}, got lengths {found}")
        times_h = [time.time_scale_h for time in self.time_scatter]
        if times_h != sorted(set(times_h)):
            found = ", ".join(f"{time_h:g} h" for time_h in times_h)
            raise ValueError(f"time scales of time_scatter must increase, got {found}")

    @cached_property
    def scale_weights(self) -> tuple[float, ...]:
        """Weight of a new reading in the sums over each time scale."""
        return tuple(ewma_weight(time.time_scale_h, self.reading_h) for time in self.time_scatter)

    @property
    def direction(self) -> str:
        """Direction "x" or "y" of the quantity."""
        return QUANTITIES[self.quantity].direction

    def compare(
        self, conditions: FilmConditions, value: FloatArray, u_random: FloatArray
    ) -> Deviations:
        """Return the deviations of readings (n,) from the learned values under their conditions.

        `value` is ln of the stiffness; `u_random` is its random standard uncertainty.
        """
        place = self.table.find(self.grid.cells(conditions))
        place = np.where(self.is_known(conditions) & np.isfinite(value), place, -1)
        n = place.size
        found = Deviations(place, np.full(n, np.nan), *np.zeros((4, n)))
        rows = np.flatnonzero(place >= 0)
        if rows.size:
            cell = place[rows]
            excess = np.maximum(u_random[rows] ** 2 - self.u_random**2, 0.0)
            variance = self.table.scatter[cell] ** 2 + excess
            found.deviation[rows] = value[rows] - self.surface.at(conditions.rows(rows))
            found.weight[rows] = np.minimum(1.0, self.scatter**2 / variance)
            found.scatter[rows] = self.table.passing[cell]
            std = self._surface_std(conditions.rows(rows), cell)
            found.surface_std[rows] = std
            found.offset_std[rows] = np.sqrt(std**2 + self.table.lasting[cell] ** 2)
            place[rows[std > self.max_surface_std]] = -1
        return found

    def compare_history(self, history: StiffnessHistory) -> Deviations:
        """Return the deviations from this baseline of all readings of its quantity in a history."""
        value, u_random, _ = history.of(self.quantity)
        return self.compare(history.conditions, value, u_random)

    def is_known(self, conditions: FilmConditions) -> BoolArray:
        """Return whether all conditions that the baseline depends on are known (n,)."""
        return conditions.is_known(self.grid.has_attitude or self.surface.shape.has_attitude)

    def eccentricity_rise(self, conditions: FilmConditions) -> FloatArray:
        """Return d ln(stiffness) / d ln(eccentricity ratio) at conditions (n,); NaN if unknown."""
        known = self.is_known(conditions)
        rise = np.full(known.size, np.nan)
        here = conditions.rows(known)
        rise[known] = here.eccentricity_ratio * self.surface.slope(here)
        return rise

    def _surface_std(self, conditions: FilmConditions, cell: IntArray) -> FloatArray:
        """Return the uncertainty of the surface (n,), with that of the attitude terms."""
        std = self._between_nodes(conditions, cell)
        if not self.surface.shape.has_attitude:
            return std
        then = replace(conditions, attitude_deg=self.table.middle.attitude_deg[cell])
        turned = attitude_terms(conditions) - attitude_terms(then)
        covariance = np.array(self.attitude_covariance)
        variance = std**2 + np.maximum(np.sum(turned * (covariance @ turned), axis=0), 0.0)
        return np.asarray(np.sqrt(variance))

    def _between_nodes(self, conditions: FilmConditions, cell: IntArray) -> FloatArray:
        """Return the uncertainty of the surface (n,), bilinear between the nodes of the cell."""
        i, along_e = _steps(conditions.eccentricity_ratio, self.grid.eccentricity_width)
        j, along_t = _steps(conditions.oil_temperature_c, self.grid.temperature_width_c)
        std = self.table.node_std
        low, high = (
            std[k, j, cell] * (1.0 - along_t) + std[k, j + 1, cell] * along_t for k in (i, i + 1)
        )
        return np.asarray(low * (1.0 - along_e) + high * along_e)


def _steps(x: FloatArray, width: float) -> tuple[IntArray, FloatArray]:
    """Return the index of the next lower node of each x, and the fraction of the step above it."""
    steps = x / width % 1.0 * (NODES - 1)
    node = np.minimum(np.floor(steps), NODES - 2)
    return node.astype(np.int64), steps - node


@dataclass(frozen=True)
class BearingBaseline:
    """Learned baseline of one bearing, from the readings of a learning period.

    Readings from `learned_from_ns` on, before `learned_until_ns` (ns since 1970 UTC), were used.
    There is at most one `QuantityBaseline` per quantity; quantities with too few readings have
    none.
    """

    origin: Origin
    learned_from_ns: int
    learned_until_ns: int
    quantities: tuple[QuantityBaseline, ...]

    def of(self, quantity: str) -> QuantityBaseline | None:
        """Return the baseline of one of the `QUANTITIES`; None if it was not learned."""
        return next((each for each in self.quantities if each.quantity == quantity), None)
