"""Rigid-rotor model of a large hydrogenerator with 10 degrees of freedom.

Source: Brito, Machado, Chaves Neto, Martini, "Experimental Estimation of Journal Bearing Stiffness
for Damage Detection in Large Hydrogenerators", section 2.2.1, equations (6) and (7).

Coordinates: X, Y of the mass centre, the tilts φ_x, φ_y, then x, y of each bearing bracket from top
to bottom. Heights are measured upward from the mass centre; a point at height z of the shaft moves
by X + z φ_y and Y − z φ_x.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from acquisition.simulated.plant.films import Film
from acquisition.simulated.plant.rotor_parameters import (
    N_SHAFT_COORDINATES,
    ForcePlane,
    RotorParameters,
)
from core.arrays import ComplexArray, FloatArray
from core.units import rad_s_from_rpm


@dataclass(frozen=True)
class RotorMatrices:
    """``M x'' + (C + Ω G) x' + K x = F`` (Brito et al., equation 6); all (10, 10), SI.

    `gyroscopic` is G alone, before it is multiplied by the speed Ω.
    """

    mass: FloatArray
    damping: FloatArray
    gyroscopic: FloatArray
    stiffness: FloatArray
    speed_rad_s: float


def rotor_matrices(
    parameters: RotorParameters, films: Mapping[str, Film], speed_rpm: float
) -> RotorMatrices:
    """Assemble the equation of motion.

    Parameters
    ----------
    films
        One for each bracket, by bearing.

    Raises
    ------
    KeyError
        If a bearing of `parameters` has no film.
    """
    ordered = [films[bracket.bearing] for bracket in parameters.brackets]
    relative = relative_motion(parameters)
    return RotorMatrices(
        mass=_mass(parameters),
        damping=relative.T @ _block_diagonal([f.damping_n_s_per_m for f in ordered]) @ relative,
        gyroscopic=_gyroscopic(parameters),
        stiffness=_structure_stiffness(parameters)
        + relative.T @ _block_diagonal([f.stiffness_n_per_m for f in ordered]) @ relative,
        speed_rad_s=rad_s_from_rpm(speed_rpm),
    )


def relative_motion(parameters: RotorParameters) -> FloatArray:
    """Map coordinates to shaft minus bracket, (6, 10): u_x, u_y of each bearing (Table 3)."""
    return np.vstack(
        [_shaft_motion(parameters, b.height_m) for b in parameters.brackets]
    ) - bracket_motion(parameters)


def bracket_motion(parameters: RotorParameters) -> FloatArray:
    """Map coordinates to bracket motion, (6, 10): x_b, y_b of each bearing."""
    return np.eye(parameters.n_coordinates)[N_SHAFT_COORDINATES:]


def force_map(parameters: RotorParameters, plane: ForcePlane) -> FloatArray:
    """Map a radial force (x, y) in a plane to generalized forces, (10, 2)."""
    height_m = {
        ForcePlane.MASS_CENTRE: 0.0,
        ForcePlane.GENERATOR: parameters.generator_height_m,
        ForcePlane.RUNNER: parameters.runner_height_m,
    }[plane]
    return _shaft_motion(parameters, height_m).T


def forward_force(parameters: RotorParameters, plane: ForcePlane, force_n: float) -> ComplexArray:
    """Phasor of a force rotating forward, F_x = F cos ωt and F_y = F sin ωt: (10,) generalized."""
    rotating: ComplexArray = np.array([force_n, -1j * force_n])
    return force_map(parameters, plane) @ rotating


def receptance(matrices: RotorMatrices, frequency_hz: float) -> ComplexArray:
    """Displacement of every coordinate per harmonic generalized force, (10, 10) in m/N."""
    omega_rad_s = 2.0 * math.pi * frequency_hz
    damping = matrices.damping + matrices.speed_rad_s * matrices.gyroscopic
    dynamic = matrices.stiffness - omega_rad_s**2 * matrices.mass + 1j * omega_rad_s * damping
    return np.linalg.inv(dynamic).astype(np.complex128, copy=False)


def bearing_response(
    parameters: RotorParameters, matrices: RotorMatrices, frequency_hz: float, force: ComplexArray
) -> dict[str, ComplexArray]:
    """Displacement phasors u_x, u_y, x_b, y_b of each bearing in metres, the signals of Table 3.

    Parameters
    ----------
    force
        (10,) phasor of the generalized force.

    Returns
    -------
    (4,) by bearing.
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


def _mass(parameters: RotorParameters) -> FloatArray:
    rotor, tilt = parameters.rotor_mass_kg, parameters.diametral_inertia_kg_m2
    brackets = [b.mass_kg for b in parameters.brackets for _ in "xy"]
    return np.diag([rotor, rotor, tilt, tilt, *brackets])


def _gyroscopic(parameters: RotorParameters) -> FloatArray:
    matrix = np.zeros((parameters.n_coordinates, parameters.n_coordinates))
    matrix[2, 3] = parameters.polar_inertia_kg_m2
    matrix[3, 2] = -parameters.polar_inertia_kg_m2
    return matrix


def _structure_stiffness(parameters: RotorParameters) -> FloatArray:
    """Stiffness of everything but the films: brackets, thrust bearing, seals, air gap."""
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
