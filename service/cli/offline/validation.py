"""Tables of the paper, recomputed and compared.

Source: Brito, Machado, Chaves Neto, Martini, "Experimental Estimation of Journal Bearing Stiffness
for Damage Detection in Large Hydrogenerators", Tables 4 to 9 and section 3.2. Amplitudes are
zero-to-peak at the frequency named. Measured values are kept as printed text, because their last
digit shows the rounding.

Errata. Section 3.2 lists the bearing amplitudes 8.9 and 16.8 µm in the wrong order: only 16.8 for
UJB and 8.9 for LJB reproduce its own stiffnesses. The Y columns of Table 8 are marked unreliable
there and those of Table 9 lack the bearing amplitudes, so only the X direction is used here.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

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

SPEED_RPM: Final = 92.3
UNBALANCE_GRADE_MM_S: Final = 4.25


@dataclass(frozen=True)
class SimulatedRow:
    """Condition of Table 4 or 5 of the paper, repeated with estimated films in Table 6 or 7.

    Parameters
    ----------
    k_xx_gn_per_m, k_cross_gn_per_m, k_yy_gn_per_m
        Film stiffness put into the model; the cross-coupled value is both k_xy and k_yx.
    original_um_pk
        |U_x|, |U_y|, |X_b|, |Y_b| of Table 4 or 5.
    k_eff_gn_per_m
        Stiffness in x and y, estimated by equation (5) and used in the model for Table 6 or 7.
    repeated_um_pk
        |U_x|, |U_y|, |X_b|, |Y_b| of Table 6 or 7.
    """

    k_xx_gn_per_m: float
    k_cross_gn_per_m: float
    k_yy_gn_per_m: float
    original_um_pk: tuple[float, float, float, float]
    k_eff_gn_per_m: tuple[float, float]
    repeated_um_pk: tuple[float, float, float, float]


@dataclass(frozen=True)
class MeasuredRow:
    """Measurement in X direction and the stiffness that the paper derives from it, as printed.

    `table` is the number of the table or section of the paper, `condition` the time or the load.
    """

    table: int | str
    condition: str
    bearing: str
    shaft_um_pk: str
    bearing_um_pk: str
    k_eff_gn_per_m: str


QUANTITIES: Final = ("u_x_um_pk", "u_y_um_pk", "x_b_um_pk", "y_b_um_pk")

TABLES: Final = {"UJB": (4, 6), "LJB": (5, 7)}
"""Original and repeated table of each bearing."""

SIMULATED: Final = {
    "UJB": (
        SimulatedRow(6.67, 0.0, 6.67, (4.3, 4.3, 24.5, 24.5), (6.72, 6.72), (4.2, 4.3, 24.4, 24.5)),
        SimulatedRow(3.33, 0.0, 3.33, (9.3, 9.3, 26.5, 26.4), (3.36, 3.35), (9.2, 9.2, 26.5, 26.5)),
        SimulatedRow(
            1.11, 0.0, 1.11, (30.6, 30.3, 29.1, 28.8), (1.12, 1.12), (30.0, 30.2, 29.0, 29.0)
        ),
        SimulatedRow(
            3.33, -0.33, 1.11, (9.7, 32.5, 26.1, 29.5), (3.18, 1.07), (9.5, 32.2, 25.9, 29.5)
        ),
        SimulatedRow(
            3.33, -0.66, 3.33, (9.7, 10.2, 26.5, 26.7), (3.22, 3.09), (9.6, 10.1, 26.4, 26.7)
        ),
    ),
    "LJB": (
        SimulatedRow(
            2.86, 0.0, 2.86, (10.0, 10.1, 13.1, 13.2), (2.91, 2.90), (9.9, 10.0, 13.2, 13.2)
        ),
        SimulatedRow(
            1.43, 0.0, 1.43, (17.2, 17.1, 11.2, 11.2), (1.45, 1.45), (17.0, 17.0, 11.2, 11.2)
        ),
        SimulatedRow(0.48, 0.0, 0.48, (36.9, 37.1, 7.9, 7.9), (0.48, 0.47), (36.5, 36.8, 8.0, 7.9)),
        SimulatedRow(
            1.43, -0.14, 0.48, (17.2, 38.4, 11.1, 7.9), (1.43, 0.46), (17.1, 38.0, 11.2, 8.0)
        ),
        SimulatedRow(
            1.43, -0.28, 1.43, (17.4, 18.0, 11.2, 11.0), (1.43, 1.36), (17.2, 17.9, 11.2, 11.1)
        ),
    ),
}
"""Conditions 1 to 5 of each bearing; the turbine bearing keeps its film of Table 2."""

TURBINE_FILM_GN_PER_M: Final = 6.67

MEASURED: Final = (
    MeasuredRow(8, "G6.65 t0", "UJB", "55", "20", "0.44"),
    MeasuredRow(8, "G6.65 t0+0.5h", "UJB", "40", "14", "0.42"),
    MeasuredRow(8, "G4.25 t1", "UJB", "89", "28", "0.37"),
    MeasuredRow(8, "G4.25 t1+5.5h", "UJB", "48", "19", "0.47"),
    MeasuredRow(8, "G4.25 t1+6.5h", "UJB", "42", "17", "0.49"),
    MeasuredRow(8, "G4.25 t1+7.0h", "UJB", "40", "24", "0.69"),
    MeasuredRow(8, "balanced t2", "UJB", "23", "3.4", "0.18"),
    MeasuredRow(8, "balanced t2+1.0h", "UJB", "12", "1.9", "0.19"),
    MeasuredRow(8, "balanced t2+6.5h", "UJB", "10", "2.1", "0.26"),
    MeasuredRow(9, "G6.65 t0", "LJB", "85", "4.1", "0.11"),
    MeasuredRow(9, "G6.65 t0+0.5h", "LJB", "71", "2.3", "0.07"),
    MeasuredRow(9, "G4.25 t1", "LJB", "68", "9.6", "0.31"),
    MeasuredRow(9, "G4.25 t1+5.5h", "LJB", "48", "5.6", "0.26"),
    MeasuredRow(9, "G4.25 t1+6.5h", "LJB", "44", "7.3", "0.37"),
    MeasuredRow(9, "G4.25 t1+7.0h", "LJB", "38", "6.5", "0.37"),
    MeasuredRow(9, "balanced t2", "LJB", "13", "0.9", "0.15"),
    MeasuredRow(9, "balanced t2+1.0h", "LJB", "12", "0.6", "0.11"),
    MeasuredRow(9, "balanced t2+6.5h", "LJB", "10", "0.7", "0.16"),
    MeasuredRow("3.2", "320 MW, 0.25x", "UJB", "68", "16.8", "0.29"),
    MeasuredRow("3.2", "320 MW, 0.25x", "LJB", "110", "8.9", "0.18"),
)
"""Tables 8 and 9 at 1× and the two figures of section 3.2 at the vortex order."""


BRACKET_STIFFNESS_N_PER_M = {b.bearing: b.stiffness_n_per_m for b in (UJB, LJB)}
N_CONDITIONS = 5


@dataclass(frozen=True)
class Row:
    """Figure of the paper, with the figure that padwatch computes and its error.

    Parameters
    ----------
    table
        Number of the table of the paper, or of the section for a figure in its text.
    quantity
        Quantity with unit; amplitudes are zero-to-peak.
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
    """Largest and root-mean-square error of rows, in percent.

    Both are absolute values, relative to the figures of the paper.
    """

    max_percent: float
    rms_percent: float


def simulated_rows() -> list[Row]:
    """Recompute Tables 4 to 7: 80 amplitudes from the frequency response of the 10-DOF model."""
    rows = [row for condition in range(N_CONDITIONS) for row in _condition_rows(condition)]
    return sorted(rows, key=lambda row: int(row.table))


def measured_rows() -> list[Row]:
    """Recompute the stiffnesses of Tables 8 and 9 (X direction) and section 3.2 by equation (5)."""
    return [_measured_row(measured) for measured in MEASURED]


def errors(rows: Sequence[Row]) -> Errors:
    """Return the largest and the root-mean-square error of the rows, at least one, in percent."""
    percent = [abs(row.error_percent) for row in rows]
    return Errors(max(percent), math.sqrt(sum(p * p for p in percent) / len(percent)))


def rounding_limits_gn_per_m(measured: MeasuredRow) -> tuple[float, float]:
    """Return the lowest and highest stiffness by equation (5) that the printed digits allow, GN/m.

    Each printed figure has an error of up to half a unit of its last digit.
    """
    shaft, half_shaft = _printed(measured.shaft_um_pk)
    bearing, half_bearing = _printed(measured.bearing_um_pk)
    _, half_stiffness = _printed(measured.k_eff_gn_per_m)
    bracket = BRACKET_STIFFNESS_N_PER_M[measured.bearing] / 1e9
    lowest = effective_stiffness_n_per_m(bearing - half_bearing, shaft + half_shaft, bracket)
    highest = effective_stiffness_n_per_m(bearing + half_bearing, shaft - half_shaft, bracket)
    return lowest - half_stiffness, highest + half_stiffness


def _condition_rows(condition: int) -> Iterator[Row]:
    printed = {bearing: rows[condition] for bearing, rows in SIMULATED.items()}
    original = {
        bearing: _film(row.k_xx_gn_per_m, row.k_yy_gn_per_m, row.k_cross_gn_per_m)
        for bearing, row in printed.items()
    }
    estimated = {bearing: _film(*row.k_eff_gn_per_m) for bearing, row in printed.items()}
    first, second = _amplitudes_um_pk(original), _amplitudes_um_pk(estimated)
    for bearing, row in printed.items():
        table, repeated = TABLES[bearing]
        yield from _rows(table, condition, bearing, row.original_um_pk, first[bearing])
        yield from _rows(repeated, condition, bearing, row.repeated_um_pk, second[bearing])


def _rows(
    table: int, condition: int, bearing: str, paper_um_pk: Iterable[float], ours: Iterable[float]
) -> Iterator[Row]:
    for quantity, printed, padwatch in zip(QUANTITIES, paper_um_pk, ours, strict=True):
        error = 100.0 * (padwatch / printed - 1.0)
        yield Row(table, condition + 1, bearing, quantity, printed, padwatch, error)


def _film(k_xx_gn_per_m: float, k_yy_gn_per_m: float, k_cross_gn_per_m: float = 0.0) -> Film:
    return Film.proportional(k_xx_gn_per_m * 1e9, k_yy_gn_per_m * 1e9, k_cross_gn_per_m * 1e9)


def _amplitudes_um_pk(films: dict[str, Film]) -> dict[str, list[float]]:
    parameters = RotorParameters()
    turbine = _film(TURBINE_FILM_GN_PER_M, TURBINE_FILM_GN_PER_M)
    matrices = rotor_matrices(parameters, films | {"TJB": turbine}, SPEED_RPM)
    force_n = unbalance_force_n(UNBALANCE_GRADE_MM_S, SPEED_RPM)
    force = forward_force(parameters, ForcePlane.MASS_CENTRE, force_n)
    response = bearing_response(parameters, matrices, hz_from_rpm(SPEED_RPM), force)
    return {name: [um_from_m(float(a)) for a in np.abs(r)] for name, r in response.items()}


def _measured_row(measured: MeasuredRow) -> Row:
    printed, bracket = float(measured.k_eff_gn_per_m), BRACKET_STIFFNESS_N_PER_M[measured.bearing]
    amplitudes_um_pk = float(measured.bearing_um_pk), float(measured.shaft_um_pk)
    padwatch = effective_stiffness_n_per_m(*amplitudes_um_pk, bracket) / 1e9
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
    """Return the value of a printed figure and half a unit of its last digit."""
    n_decimals = len(figure.partition(".")[2])
    return float(figure), 0.5 * 10.0**-n_decimals
