"""Tilting pads under a flexible rotor: a plant that shares nothing with the simulated one.

The shaft is a beam of finite elements (Euler and Bernoulli), with generator rotor and runner as
discs. Forces act on all of its nodes. Spectra are drawn directly, without time series.
"""

from collections.abc import Mapping
from functools import cache

import numpy as np

from acquisition.simulated.plant.films import Film
from benchmarks.pads import PADS, WARM_UM
from core.arrays import ComplexArray, FloatArray
from core.machine.unit import BracketDynamics
from core.spectra.cross_spectrum import phasor_power_per_density

FREQUENCY_HZ = 600.0 / 8192 * np.arange(1, 342)
BIN_HZ = float(FREQUENCY_HZ[0])
TURN_HZ = 92.3 / 60.0
SPEED_RAD_S = 2.0 * np.pi * TURN_HZ
HEIGHT_M = np.array([-12.617, -10.7, -8.767, -6.0, -3.0, 0.088, 2.328, 3.9, 5.433])
BEARINGS = {"UJB": 8, "LJB": 5, "TJB": 2}
BRACKETS = {
    "UJB": BracketDynamics(1.18e9, 0.45e5),
    "LJB": BracketDynamics(2.22e9, 1.00e5),
    "TJB": BracketDynamics(2.13e9, 0.80e5),
}
DENSITY_KG_PER_M3, OUTER_M, INNER_M = 7850.0, 1.4, 0.6
YOUNG_PA = {8.0: 6.956e10, 11.7: 2.06e11, 25.0: 1.226e12}
"""Modulus of elasticity, by the first bending frequency in Hz on films of 0.5 GN/m; of steel it is
2.06e11."""

DISCS = {6: (1.75e6, 4.0e7, 7.5e7), 0: (3.5e5, 2.5e6, 4.0e6)}
"""Node of a disc: mass, diametral and polar inertia of generator rotor and runner."""

THRUST_N_M_PER_RAD, SEAL_N_PER_M = 4.33e10, 5.0e7
N_COORDINATES = 4 * HEIGHT_M.size  # x, its slope, y, its slope of each node
N_FORCES = 2 * HEIGHT_M.size
FORCE_N_RMS = 2000.0


def hann_noise(
    rng: np.random.Generator, n_segments: int, n_channels: int, n_lines: int = FREQUENCY_HZ.size
) -> ComplexArray:
    """Return white noise of unit power, (n_segments, n_channels, n_lines).

    Neighbouring lines have the correlation that Hann's taper gives.
    """
    shape = (n_segments, n_channels, n_lines + 2)
    white = rng.normal(size=shape) + 1j * rng.normal(size=shape)
    return (white[..., 1:-1] - 0.5 * (white[..., :-2] + white[..., 2:])) / np.sqrt(3.0)


def beam(young_pa: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return stiffness, mass and gyroscopic matrices of the shaft, without bearings, (36, 36)."""
    area = np.pi / 4.0 * (OUTER_M**2 - INNER_M**2)
    bending = young_pa * np.pi / 64.0 * (OUTER_M**4 - INNER_M**4)
    stiffness, mass, gyroscopic = (np.zeros((N_COORDINATES, N_COORDINATES)) for _ in range(3))
    for node, length in enumerate(np.diff(HEIGHT_M)):
        a = float(length)
        k = (bending / a**3) * np.array(
            [
                [12.0, 6.0 * a, -12.0, 6.0 * a],
                [6.0 * a, 4.0 * a**2, -6.0 * a, 2.0 * a**2],
                [-12.0, -6.0 * a, 12.0, -6.0 * a],
                [6.0 * a, 2.0 * a**2, -6.0 * a, 4.0 * a**2],
            ]
        )
        m = (DENSITY_KG_PER_M3 * area * a / 420.0) * np.array(
            [
                [156.0, 22.0 * a, 54.0, -13.0 * a],
                [22.0 * a, 4.0 * a**2, 13.0 * a, -3.0 * a**2],
                [54.0, 13.0 * a, 156.0, -22.0 * a],
                [-13.0 * a, -3.0 * a**2, -22.0 * a, 4.0 * a**2],
            ]
        )
        for axis in (0, 2):
            at = 4 * node + axis + np.array([0, 1, 4, 5])
            stiffness[np.ix_(at, at)] += k
            mass[np.ix_(at, at)] += m
    for node, (disc_kg, diametral, polar) in DISCS.items():
        x = 4 * node
        for axis in (x, x + 2):
            mass[axis, axis] += disc_kg
            mass[axis + 1, axis + 1] += diametral
        gyroscopic[x + 1, x + 3], gyroscopic[x + 3, x + 1] = polar, -polar
    for axis in (0, 2):
        stiffness[4 * BEARINGS["LJB"] + axis + 1, 4 * BEARINGS["LJB"] + axis + 1] += (
            THRUST_N_M_PER_RAD
        )
        stiffness[axis, axis] += SEAL_N_PER_M
    return stiffness, mass, gyroscopic


def bending_hz(young_pa: float) -> float:
    """Return the first bending frequency of the shaft at rest on films of 0.5 GN/m."""
    stiffness, mass, _ = beam(young_pa)
    for node in BEARINGS.values():
        stiffness[[4 * node, 4 * node + 2], [4 * node, 4 * node + 2]] += 0.5e9
    natural = np.sort(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real)
    # below are translation, tilt and the runner on its bearing, in two planes each
    return float(np.sqrt(natural[6]) / (2.0 * np.pi))


def tilting_films(eccentricity: float) -> dict[str, Film]:
    """Return films of the warm bearings with the shaft displaced at 53° from x towards y."""
    films = {}
    for name, um in WARM_UM.items():
        centre_um = 0.6 * eccentricity * um, 0.8 * eccentricity * um
        pads_um = np.full(PADS[name].n_pads, um)
        films[name] = PADS[name].film(pads_um, centre_um, 0.029, 92.3)
    return films


@cache
def motion(
    eccentricity: float, bends_at_hz: float
) -> tuple[Mapping[str, Film], Mapping[str, ComplexArray]]:
    """Return films, and u_x, u_y, x_b, y_b of each bearing per force on each node, (n, 4, 18)."""
    found = tilting_films(eccentricity)
    stiffness, mass, gyroscopic = beam(YOUNG_PA[bends_at_hz])
    forces = np.zeros((N_COORDINATES, N_FORCES))
    forces[[4 * (n // 2) + 2 * (n % 2) for n in range(N_FORCES)], range(N_FORCES)] = 1
    moves = {name: np.zeros((FREQUENCY_HZ.size, 4, N_FORCES), complex) for name in BEARINGS}
    for line, omega in enumerate(2.0 * np.pi * FREQUENCY_HZ):
        whole = stiffness * (1.0 + 0.01j) - omega**2 * mass + 1j * omega * SPEED_RAD_S * gyroscopic
        shares = {}
        for name, node in BEARINGS.items():
            film = found[name].dynamic_stiffness_n_per_m(omega)
            bracket = BRACKETS[name].dynamic_stiffness_n_per_m(FREQUENCY_HZ[[line]])[0]
            # film and bracket in series: z_b v = z (x − v)
            shares[name] = np.linalg.solve(film + bracket * np.eye(2), film)
            at = 4 * node + np.array([0, 2])
            whole[np.ix_(at, at)] += bracket * shares[name]
        shaft = np.linalg.solve(whole, forces)
        for name, node in BEARINGS.items():
            x = shaft[4 * node + np.array([0, 2])]
            moves[name][line] = np.concatenate([x - shares[name] @ x, shares[name] @ x])
    return found, moves


def recording(
    bearing: str, eccentricity: float, seed: int, n_segments: int, bends_at_hz: float = 11.7
) -> ComplexArray:
    """Draw phasors of one bearing in µm, (n_segments, 4, 341), with realistic transducer noise.

    The force on each node is 2 kN rms up to 20 Hz.
    """
    rng = np.random.default_rng(seed)
    density = 2.0 * FORCE_N_RMS**2 / 20.0
    size_n = np.sqrt(density / 2.0 * phasor_power_per_density(BIN_HZ))
    forces = size_n * hann_noise(rng, n_segments, N_FORCES)
    moves = motion(eccentricity, bends_at_hz)[1][bearing]
    phasors = 1e6 * np.einsum("lcf,sfl->scl", moves, forces)
    probe_um = 1.2 / np.sqrt(300.0)
    accelerometer_um = 5e-6 * 9.81e6 / (2.0 * np.pi * FREQUENCY_HZ) ** 2
    noise = np.stack([np.full(FREQUENCY_HZ.size, probe_um), accelerometer_um]).repeat(2, axis=0)
    scale = np.sqrt(phasor_power_per_density(BIN_HZ) / 2.0)
    return np.asarray(phasors + scale * noise * hann_noise(rng, n_segments, 4))
