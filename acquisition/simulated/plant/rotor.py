"""10-DOF rotor model of Brito et al.: parameters, matrices and harmonic response.

The shapes of arrays are given for three bearings.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from acquisition.simulated.plant.films import Film
from core.arrays import ComplexArray, FloatArray
from core.units import rad_s_from_rpm

N_SHAFT_COORDINATES = 4
"""Number of shaft coordinates: position X, Y of the mass centre and tilts φ_x, φ_y."""

UNBALANCE_REFERENCE_FORCE_N = 75.6e3
"""Unbalance force of ISO balance grade G4.25 at 92.3 r/min, from Table 4 of Brito et al."""
UNBALANCE_REFERENCE_GRADE_MM_S = 4.25
UNBALANCE_REFERENCE_SPEED_RPM = 92.3


@dataclass(frozen=True)
class Bracket:
    """Support structure of a guide bearing: an effective mass on an isotropic spring.

    Parameters
    ----------
    height_m
        Height of the bearing above the mass centre of the rotor.
    """

    bearing: str
    height_m: float
    mass_kg: float
    stiffness_n_per_m: float


UJB = Bracket("UJB", height_m=5.433, mass_kg=0.45e5, stiffness_n_per_m=1.18e9)
LJB = Bracket("LJB", height_m=0.088, mass_kg=1.00e5, stiffness_n_per_m=2.22e9)
TJB = Bracket("TJB", height_m=-8.767, mass_kg=0.80e5, stiffness_n_per_m=2.13e9)


@dataclass(frozen=True)
class RotorParameters:
    """Rigid rotor on three brackets; the defaults are Table 2 of Brito et al.

    Parameters
    ----------
    magnetic_stiffness_n_per_m
        Stiffness of the air gap of the generator. Table 2 gives -0.60e9 for the excited machine;
        the default and the simulations of Brito et al. are for the machine without excitation.
    thrust_stiffness_n_per_m
        Axial stiffness of the thrust bearing. Brito et al. do not describe its effect; their tables
        are reproduced if the thrust pads resist tilt.
    thrust_radius_m
        Radius of the circle of the thrust pads.
    """

    rotor_mass_kg: float = 2.37e6
    polar_inertia_kg_m2: float = 0.84e8
    diametral_inertia_kg_m2: float = 1.09e8
    brackets: tuple[Bracket, ...] = (UJB, LJB, TJB)
    generator_height_m: float = 2.328
    runner_height_m: float = -12.617
    magnetic_stiffness_n_per_m: float = 0.0
    seal_stiffness_n_per_m: float = 5.0e7
    thrust_stiffness_n_per_m: float = 19.4e9
    thrust_radius_m: float = 2.113

    @property
    def tilt_stiffness_n_m_per_rad(self) -> float:
        """Tilt stiffness k₈ l₅² / 2 of evenly spaced thrust pads about a diameter."""
        return self.thrust_stiffness_n_per_m * self.thrust_radius_m**2 / 2.0

    @property
    def n_coordinates(self) -> int:
        """Number of degrees of freedom: four of the shaft and two of each bracket."""
        return N_SHAFT_COORDINATES + 2 * len(self.brackets)


class ForcePlane(StrEnum):
    """Plane in which a radial force acts on the rotor."""

    MASS_CENTRE = "mass_centre"
    GENERATOR = "generator"
    RUNNER = "runner"


def unbalance_force_n(grade_mm_s: float, speed_rpm: float) -> float:
    """Return the unbalance force in N at a speed, for an ISO balance grade at 92.3 r/min.

    The force of an unbalanced mass is proportional to the square of the speed.
    """
    grade = grade_mm_s / UNBALANCE_REFERENCE_GRADE_MM_S
    return UNBALANCE_REFERENCE_FORCE_N * grade * (speed_rpm / UNBALANCE_REFERENCE_SPEED_RPM) ** 2


@dataclass(frozen=True)
class RotorMatrices:
    """Matrices of ``M x'' + (C + Ω G) x' + K x = F`` (Brito et al., eq. 6), (10, 10) in SI units.

    `gyroscopic` is G without the factor Ω. `stiffness` and `damping` are those of pads that do not
    tilt with the whirl. Each `TiltLag` of a film adds ``R w`` to the forces along its row of
    `lag_map`, where ``τ w' + w`` is the motion along that row.

    Parameters
    ----------
    lag_map, lag_n_per_m, lag_s
        (n_lags, 10) maps from coordinates to motion towards pivots, (n_lags,) R and (n_lags,) τ.
    """

    mass: FloatArray
    damping: FloatArray
    gyroscopic: FloatArray
    stiffness: FloatArray
    speed_rad_s: float
    lag_map: FloatArray
    lag_n_per_m: FloatArray
    lag_s: FloatArray


def rotor_matrices(
    parameters: RotorParameters, films: Mapping[str, Film], speed_rpm: float
) -> RotorMatrices:
    """Return the matrices of the equation of motion.

    Parameters
    ----------
    films
        Film of each bracket, by bearing id.

    Raises
    ------
    KeyError
        If a bearing of `parameters` has no film.
    """
    ordered = [films[bracket.bearing] for bracket in parameters.brackets]
    relative = relative_motion(parameters)
    lags = [
        (lag.along @ relative[2 * row : 2 * row + 2], lag.n_per_m, lag.lag_s)
        for row, film in enumerate(ordered)
        for lag in film.lags
    ]
    lag_map = np.array([row for row, _, _ in lags]).reshape(-1, parameters.n_coordinates)
    lag_n_per_m, lag_s = np.array([sizes for _, *sizes in lags]).reshape(-1, 2).T
    damping = relative.T @ _block_diagonal([f.damping_n_s_per_m for f in ordered]) @ relative
    films_n_per_m = relative.T @ _block_diagonal([f.stiffness_n_per_m for f in ordered]) @ relative
    rotor_kg, tilt = parameters.rotor_mass_kg, parameters.diametral_inertia_kg_m2
    brackets_kg = [b.mass_kg for b in parameters.brackets for _ in "xy"]
    gyroscopic = np.zeros_like(damping)
    gyroscopic[2, 3] = parameters.polar_inertia_kg_m2
    gyroscopic[3, 2] = -parameters.polar_inertia_kg_m2
    return RotorMatrices(
        mass=np.diag([rotor_kg, rotor_kg, tilt, tilt, *brackets_kg]),
        # (iωτ)² / (1 + iωτ) = 1/(1 + iωτ) − 1 + iωτ
        damping=damping + (lag_map.T * lag_n_per_m * lag_s) @ lag_map,
        gyroscopic=gyroscopic,
        stiffness=_structure_stiffness(parameters)
        + films_n_per_m
        - (lag_map.T * lag_n_per_m) @ lag_map,
        speed_rad_s=rad_s_from_rpm(speed_rpm),
        lag_map=lag_map,
        lag_n_per_m=lag_n_per_m,
        lag_s=lag_s,
    )


def relative_motion(parameters: RotorParameters) -> FloatArray:
    """Return the matrix (6, 10) from coordinates to u_x, u_y of bearings (Brito et al., Table 3).

    u is shaft minus bracket motion.
    """
    return np.vstack(
        [_shaft_motion(parameters, b.height_m) for b in parameters.brackets]
    ) - bracket_motion(parameters)


def bracket_motion(parameters: RotorParameters) -> FloatArray:
    """Return the matrix from coordinates to bracket motion x_b, y_b of each bearing, (6, 10)."""
    return np.eye(parameters.n_coordinates)[N_SHAFT_COORDINATES:]


def force_map(parameters: RotorParameters, plane: ForcePlane) -> FloatArray:
    """Return the matrix from a radial force (x, y) in a plane to generalized forces, (10, 2)."""
    height_m = {
        ForcePlane.MASS_CENTRE: 0.0,
        ForcePlane.GENERATOR: parameters.generator_height_m,
        ForcePlane.RUNNER: parameters.runner_height_m,
    }[plane]
    return _shaft_motion(parameters, height_m).T


def forward_force(parameters: RotorParameters, plane: ForcePlane, force_n: float) -> ComplexArray:
    """Return the generalized force phasor of (F cos ωt, F sin ωt) in a plane, (10,)."""
    rotating: ComplexArray = np.array([force_n, -1j * force_n])
    return force_map(parameters, plane) @ rotating


def receptance(matrices: RotorMatrices, frequency_hz: float) -> ComplexArray:
    """Return the receptance matrix: displacement per harmonic force, (10, 10) in m/N."""
    omega_rad_s = 2.0 * math.pi * frequency_hz
    damping = matrices.damping + matrices.speed_rad_s * matrices.gyroscopic
    dynamic = matrices.stiffness - omega_rad_s**2 * matrices.mass + 1j * omega_rad_s * damping
    lagging = matrices.lag_n_per_m / (1.0 + 1j * omega_rad_s * matrices.lag_s)
    dynamic += (matrices.lag_map.T * lagging) @ matrices.lag_map
    return np.linalg.inv(dynamic).astype(np.complex128, copy=False)


def bearing_response(
    parameters: RotorParameters, matrices: RotorMatrices, frequency_hz: float, force: ComplexArray
) -> dict[str, ComplexArray]:
    """Return the phasors (4,) of u_x, u_y, x_b and y_b in metres, by bearing id.

    They are the signals of Table 3 of Brito et al. `force` (10,) is the generalized force phasor.
    """
    coordinates = receptance(matrices, frequency_hz) @ force
    shaft = (relative_motion(parameters) @ coordinates).reshape(-1, 2)
    bracket = (bracket_motion(parameters) @ coordinates).reshape(-1, 2)
    names = [b.bearing for b in parameters.brackets]
    return {n: np.concatenate(pair) for n, *pair in zip(names, shaft, bracket, strict=True)}


def _shaft_motion(parameters: RotorParameters, height_m: float) -> FloatArray:
    rows = np.zeros((2, parameters.n_coordinates))
    rows[0, [0, 3]] = 1.0, height_m
    rows[1, [1, 2]] = 1.0, -height_m
    return rows


def _structure_stiffness(parameters: RotorParameters) -> FloatArray:
    """Return the stiffness matrix without films: brackets, thrust bearing, seals, air gap."""
    tilt = parameters.tilt_stiffness_n_m_per_rad
    brackets = [b.stiffness_n_per_m for b in parameters.brackets for _ in "xy"]
    seals = _shaft_motion(parameters, parameters.runner_height_m)
    air_gap = _shaft_motion(parameters, parameters.generator_height_m)
    return (
        np.diag([0.0, 0.0, tilt, tilt, *brackets])
        + parameters.seal_stiffness_n_per_m * seals.T @ seals
        + parameters.magnetic_stiffness_n_per_m * air_gap.T @ air_gap
    )


def _block_diagonal(blocks: list[FloatArray]) -> FloatArray:
    matrix = np.zeros((2 * len(blocks), 2 * len(blocks)))
    for index, block in enumerate(blocks):
        matrix[2 * index : 2 * index + 2, 2 * index : 2 * index + 2] = block
    return matrix
