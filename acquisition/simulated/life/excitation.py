"""Unbalance, hydraulic force and vortex rope in a simulated life, and the response at 1×."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from acquisition.simulated.life.bearing import STANDING_TIME_FACTOR
from acquisition.simulated.life.operation import Operation, lagged, wander
from acquisition.simulated.plant.films import Film, FilmColumns
from acquisition.simulated.plant.rotor import (
    N_SHAFT_COORDINATES,
    RotorParameters,
    rotor_matrices,
    unbalance_force_n,
)
from core.arrays import ComplexArray, FloatArray
from core.units import um_from_m

WARM_UNBALANCE = 0.76
"""Ratio of the unbalance of the warm rotor to that of the cold rotor.

Fitted: with the films of Table 8 (Brito et al.), the shaft motion at the UJB decreases from 85 to
51 µm. The measured motion of both bearings decreased too, which the films do not explain.
"""

WARM_UNBALANCE_TIME_S = 1.2 * 3600.0

BALANCED_GRADES_MM_S = (0.8, 2.0)
MAGNETIC_UNBALANCE = 0.12
"""Relative increase of the unbalance at full load by the magnetic field."""

GRADE_WANDER, GRADE_TIME_S = 0.03, 5.0 * 86_400.0

NO_LOAD_FORCE_N = 6.0e3
FULL_LOAD_FORCE_N = 20.0e3
"""Rms of the broadband hydraulic force without load and at full load.

The force at full load is that of the accuracy trial of the design."""

VORTEX_LOADS = (0.35, 0.65)
"""Load range with a vortex rope in a Francis turbine, as a share of rated power (320 MW of 700 MW
in Brito et al., section 3.2)."""

VORTEX_FORCE_N = 60.0e3
VORTEX_TURBULENCE = 1.6
"""Factor of the broadband hydraulic force in the load range `VORTEX_LOADS`."""


def warm_unbalance(operation: Operation) -> FloatArray:
    """Return the ratio of the unbalance to that of the cold rotor, (n,)."""
    turns = operation.is_turning
    time_s = WARM_UNBALANCE_TIME_S * np.where(turns, 1.0, STANDING_TIME_FACTOR)
    return lagged(np.where(turns, WARM_UNBALANCE, 1.0), time_s, operation.step_s, 1.0)


def draw_grade_mm_s(random: np.random.Generator, operation: Operation) -> FloatArray:
    """Draw the residual unbalance of a balanced machine as an ISO grade in mm/s, (n,)."""
    cold_mm_s = random.uniform(*BALANCED_GRADES_MM_S) / WARM_UNBALANCE
    magnetic = 1.0 + MAGNETIC_UNBALANCE * operation.load
    slow = wander(random, len(operation), operation.step_s, GRADE_TIME_S, GRADE_WANDER)
    return np.asarray(cold_mm_s * warm_unbalance(operation) * magnetic * np.exp(slow))


def has_vortex(load: FloatArray) -> FloatArray:
    """Return the relative strength of the vortex rope at given loads, from 0 to 1, (n,).

    It rises and falls linearly over 5 % of rated power at the ends of the load range.
    """
    low, high = VORTEX_LOADS
    rising = np.clip((load - low) / 0.05, 0.0, 1.0)
    return rising * np.clip((high - load) / 0.05, 0.0, 1.0)


def hydraulic_force_n(load: FloatArray) -> FloatArray:
    """Return the rms of the broadband hydraulic force in each direction at given loads, (n,)."""
    smooth_n = NO_LOAD_FORCE_N + (FULL_LOAD_FORCE_N - NO_LOAD_FORCE_N) * np.clip(load, 0.0, 1.0)
    return smooth_n * (1.0 + (VORTEX_TURBULENCE - 1.0) * has_vortex(load))


NO_FILM = Film.proportional(0.0, 0.0)
SHAFT = slice(0, N_SHAFT_COORDINATES)


def order1_um_pk(
    films: Mapping[str, FilmColumns],
    bracket_factors: Mapping[str, FloatArray],
    speed_rpm: float,
    grade_mm_s: FloatArray,
    rotor: RotorParameters,
) -> dict[str, ComplexArray]:
    """Return the response at 1× to an unbalance at the mass centre, by the model of `plant.rotor`.

    Brackets are eliminated: with D = K + iΩC of the film and b = k_b − m_b Ω² of the bracket, the
    stiffness of the support is (D⁻¹ + b⁻¹)⁻¹, which reduces ten equations to four.

    Parameters
    ----------
    bracket_factors : (n,) by bearing
        Ratio of the true bracket stiffness to that of `rotor`.
    speed_rpm
        Rated speed; its variation is negligible.
    grade_mm_s : (n,)
        Unbalance as an ISO balance grade.

    Returns
    -------
    (4, n) by bearing: phasors of u_x, u_y, x_b, y_b in µm.
    """
    alone = rotor_matrices(rotor, {b.bearing: NO_FILM for b in rotor.brackets}, speed_rpm)
    omega = alone.speed_rad_s
    free = alone.stiffness - omega**2 * alone.mass + 1j * omega**2 * alone.gyroscopic
    dynamic = np.tile(free[SHAFT, SHAFT], (grade_mm_s.size, 1, 1))
    shares = {}
    for bracket in rotor.brackets:
        spring = bracket.stiffness_n_per_m * bracket_factors[bracket.bearing]
        b = spring - bracket.mass_kg * omega**2
        film = _matrices(films[bracket.bearing], omega)
        b = b[:, np.newaxis, np.newaxis]
        share = _inverse(film + b * np.eye(2)) * b
        motion = _shaft_motion(bracket.height_m)
        dynamic += motion.T @ (film @ share) @ motion
        shares[bracket.bearing] = share, motion
    force = np.zeros((grade_mm_s.size, N_SHAFT_COORDINATES, 1), dtype=np.complex128)
    unit_force_n = unbalance_force_n(1.0, speed_rpm)
    force[:, 0, 0], force[:, 1, 0] = unit_force_n * grade_mm_s, -1j * unit_force_n * grade_mm_s
    shaft = np.linalg.solve(dynamic, force)
    return {name: _split(share, motion @ shaft) for name, (share, motion) in shares.items()}


def rotor_of(ids: tuple[str, ...]) -> RotorParameters:
    """Return the rotor of Brito et al. with only the brackets of the bearings `ids`."""
    rotor = RotorParameters()
    return replace(rotor, brackets=tuple(b for b in rotor.brackets if b.bearing in ids))


def _shaft_motion(height_m: float) -> FloatArray:
    """Return the matrix (2, 4) from X, Y, φ_x, φ_y to shaft motion x, y at a height.

    `height_m` is the height above the mass centre (Brito et al., Table 3).
    """
    return np.array([[1.0, 0.0, 0.0, height_m], [0.0, 1.0, -height_m, 0.0]])


def _split(share: ComplexArray, shaft_m: ComplexArray) -> ComplexArray:
    """Return the shaft motion relative to the bearing and the bearing motion in µm, (4, n)."""
    relative = (share @ shaft_m)[:, :, 0].T
    return np.asarray(um_from_m(1.0) * np.concatenate([relative, shaft_m[:, :, 0].T - relative]))


def _matrices(film: FilmColumns, omega: float) -> ComplexArray:
    """Return the dynamic stiffness of a film at the running speed, (n, 2, 2)."""
    k = np.array([film.k_xx_n_per_m, film.k_xy_n_per_m, film.k_yy_n_per_m])
    return np.moveaxis((k + 1j * omega * film.c_n_s_per_m)[[[0, 1], [1, 2]]], -1, 0)


def _inverse(matrix: ComplexArray) -> ComplexArray:
    """Return the inverses of symmetric 2×2 matrices, (n, 2, 2)."""
    a, b, d = matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 1, 1]
    inverse = np.moveaxis(np.array([[d, -b], [-b, a]]), -1, 0)
    return np.asarray(inverse / (a * d - b * b)[:, np.newaxis, np.newaxis])
