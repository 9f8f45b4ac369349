"""The paper's figures, recomputed by padwatch, row by row."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.simulated.plant.films import Film
from acquisition.simulated.plant.rotor import (
    LJB,
    UJB,
    ForcePlane,
    RotorParameters,
    bearing_response,
    forward_force,
    rotor_matrices,
    unbalance_force_n,
)
from core.stiffness.stiffness_budget import effective_stiffness_n_per_m
from core.units import hz_from_rpm, um_from_m
from service.cli.offline.validation import paper

BRACKET_STIFFNESS_N_PER_M = {b.bearing: b.stiffness_n_per_m for b in (UJB, LJB)}
N_CONDITIONS = 5


@dataclass(frozen=True)
class Row:
    """One printed figure beside padwatch's.

    Parameters
    ----------
    table
        Number of the table, or of the section where the figure stands in the text.
    quantity
        With unit; amplitudes are zero-to-peak.
    """

    table: int | str
    condition: int | str
    bearing: str
    quantity: str
    paper: float
    padwatch: float
    error_percent: float


@dataclass(frozen=True)
class Errors:
    """Summary of :attr:`Row.error_percent`."""

    max_percent: float
    rms_percent: float


def simulated_rows() -> list[Row]:
    """Tables 4 to 7: 80 amplitudes from the frequency response of the 10-DOF model."""
    rows: list[Row] = []
    for condition in range(N_CONDITIONS):
        rows += _condition_rows(condition)
    return sorted(rows, key=lambda row: int(row.table))


def measured_rows() -> list[Row]:
    """Tables 8 and 9 (X direction) and section 3.2: equation (5) on the printed amplitudes."""
    return [_measured_row(measured) for measured in paper.MEASURED]


def errors(rows: Sequence[Row]) -> Errors:
    """Largest and root-mean-square error.

    Raises
    ------
    ValueError
        If there are no rows.
    """
    percent = [abs(row.error_percent) for row in rows]
    if not percent:
        raise ValueError("no rows to summarize")
    return Errors(max(percent), math.sqrt(sum(p * p for p in percent) / len(percent)))


def rounding_limits_gn_per_m(measured: paper.MeasuredRow) -> tuple[float, float]:
    """Where the printed stiffness must lie if equation (5) made it from the unrounded amplitudes.

    Each printed amplitude stands for half a unit of its last digit either way, and so does the
    printed stiffness.
    """
    shaft, half_shaft = _printed(measured.shaft_um_pk)
    bearing, half_bearing = _printed(measured.bearing_um_pk)
    _, half_stiffness = _printed(measured.k_eff_gn_per_m)
    bracket = BRACKET_STIFFNESS_N_PER_M[measured.bearing] / 1e9
    lowest = effective_stiffness_n_per_m(bearing - half_bearing, shaft + half_shaft, bracket)
    highest = effective_stiffness_n_per_m(bearing + half_bearing, shaft - half_shaft, bracket)
    return lowest - half_stiffness, highest + half_stiffness


def _condition_rows(condition: int) -> Iterator[Row]:
    printed = {bearing: rows[condition] for bearing, rows in paper.SIMULATED.items()}
    original = {
        bearing: _film(row.k_xx_gn_per_m, row.k_yy_gn_per_m, row.k_cross_gn_per_m)
        for bearing, row in printed.items()
    }
    estimated = {bearing: _film(*row.k_eff_gn_per_m) for bearing, row in printed.items()}
    first, second = _amplitudes_um_pk(original), _amplitudes_um_pk(estimated)
    for bearing, row in printed.items():
        table, repeated = paper.TABLES[bearing]
        yield from _rows(table, condition, bearing, row.original_um_pk, first[bearing])
        yield from _rows(repeated, condition, bearing, row.repeated_um_pk, second[bearing])


def _rows(
    table: int, condition: int, bearing: str, paper_um_pk: Iterable[float], ours: Iterable[float]
) -> Iterator[Row]:
    for quantity, printed, padwatch in zip(paper.QUANTITIES, paper_um_pk, ours, strict=True):
        error = 100.0 * (padwatch / printed - 1.0)
        yield Row(table, condition + 1, bearing, quantity, printed, padwatch, error)


def _film(k_xx_gn_per_m: float, k_yy_gn_per_m: float, k_cross_gn_per_m: float = 0.0) -> Film:
    return Film.proportional(k_xx_gn_per_m * 1e9, k_yy_gn_per_m * 1e9, k_cross_gn_per_m * 1e9)


def _amplitudes_um_pk(films: dict[str, Film]) -> dict[str, list[float]]:
    parameters = RotorParameters()
    turbine = _film(paper.TURBINE_FILM_GN_PER_M, paper.TURBINE_FILM_GN_PER_M)
    matrices = rotor_matrices(parameters, films | {"TJB": turbine}, paper.SPEED_RPM)
    force_n = unbalance_force_n(paper.UNBALANCE_GRADE_MM_S, paper.SPEED_RPM)
    force = forward_force(parameters, ForcePlane.MASS_CENTRE, force_n)
    response = bearing_response(parameters, matrices, hz_from_rpm(paper.SPEED_RPM), force)
    return {name: [um_from_m(float(a)) for a in np.abs(r)] for name, r in response.items()}


def _measured_row(measured: paper.MeasuredRow) -> Row:
    printed = float(measured.k_eff_gn_per_m)
    padwatch = (
        effective_stiffness_n_per_m(
            float(measured.bearing_um_pk),
            float(measured.shaft_um_pk),
            BRACKET_STIFFNESS_N_PER_M[measured.bearing],
        )
        / 1e9
    )
    return Row(
        table=measured.table,
        condition=measured.condition,
        bearing=measured.bearing,
        quantity="k_eff_xx_gn_per_m",
        paper=printed,
        padwatch=padwatch,
        error_percent=100.0 * (padwatch / printed - 1.0),
    )


def _printed(figure: str) -> tuple[float, float]:
    """Value of a printed figure and half a unit of its last digit."""
    n_decimals = len(figure.partition(".")[2])
    return float(figure), 0.5 * 10.0**-n_decimals
