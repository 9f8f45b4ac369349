"""Weighted least-squares fit of the films of several bearings to their averaged cross-spectra.

For row i of ``z_b V = (K + iωC) U``, four real numbers (k_i1, k_i2, c_i1, c_i2) minimise
``Σ_lines w Σ_segments |z_b v_i - Σ_j (k_ij + iω c_ij) u_j|²``. The sums over segments are entries
of the cross-spectrum matrix; the segments themselves are not needed.

Bearing comes first in all arrays, line last, so that each step is one operation for all bearings.
"""

from collections.abc import Sequence
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt

from core.arrays import ComplexArray, FloatArray
from core.spectra.cross_spectrum import BEARING_X
from core.stiffness.dynamic_lines import conditional_power, own_power

MIN_SHARE = 0.05
"""Smallest fraction of motion in the shaft spectra. With less, the spectra without noise may be
singular."""

ROUNDING = 1e-12
"""Residual power of noise-free signals, due to rounding, as a fraction of the force's power."""

SMOOTHING_REACH_BINS = 6
"""Number of bins to each side over which the residual spectrum is smoothed for the weights."""

N_ITERATIONS = 4
"""Number of iterations of fit and weights; the third changes stiffness by less than 0.01 %."""

N_UNKNOWNS = 4


class FilmLines:
    """Cross-spectra at the used lines of n bearings, and the normal equations of their films.

    The unknowns are stiffness and damping times `omega_unit`, both in N/m. Bearings with fewer
    lines than others are filled up with their last line, which then has no weight.

    Parameters
    ----------
    matrices : (n_lines, 4, 4) of each bearing
        Cross-spectra of (u_x, u_y, v_x, v_y) at all lines.
    lines : (n_used,) of each bearing
        Indices of the used lines, ascending.
    frequency_hz : (n_lines,)
    noise_power : (n, 2)
        Mean squared phasor of each probe's noise.

    Attributes
    ----------
    lines, frequency_hz, omega : (n, n_used)
        Indices, frequencies and angular frequencies of the used lines.
    counted : (n, 1, n_used)
        1 for lines of the bearing, 0 for the repeated last line.
    omega_unit : (n, 1)
        Angular frequency that scales damping to N/m, comparable with stiffness.
    ratio : (n, n_used)
        Angular frequencies over `omega_unit`.
    shaft : (n, 2, 2, n_used)
        Cross-spectra of the shaft's motion, with the probes' noise.
    cross : (n, 2, 2, n_used)
        Cross-spectra of the bearing's with the shaft's (conjugated) motion.
    bearing : (n, 2, 2, n_used)
        Cross-spectra of the bearing's motion.
    """

    def __init__(
        self,
        matrices: Sequence[ComplexArray],
        lines: Sequence[npt.NDArray[np.int64]],
        frequency_hz: FloatArray,
        noise_power: FloatArray,
    ) -> None:
        sizes = np.array([[own.size] for own in lines])
        place = np.arange(sizes.max())
        self.lines = np.array(
            [own[at] for own, at in zip(lines, np.minimum(place, sizes - 1), strict=True)]
        )
        self.counted = (place < sizes).astype(np.float64)[:, np.newaxis]
        self.noise_power = noise_power
        self.frequency_hz = frequency_hz[self.lines]
        self.omega = 2.0 * np.pi * self.frequency_hz
        self.omega_unit = np.einsum("nrl,nl->nr", self.counted, self.omega) / sizes
        self.ratio = self.omega / self.omega_unit
        used = [matrix[own] for matrix, own in zip(matrices, self.lines, strict=True)]
        matrix = np.ascontiguousarray(np.array(used).transpose(0, 2, 3, 1))
        self.shaft = matrix[:, :BEARING_X, :BEARING_X]
        self.cross, self.bearing = (
            matrix[:, BEARING_X:, :BEARING_X],
            matrix[:, BEARING_X:, BEARING_X:],
        )
        self.smoothing = smoother(tuple(tuple(own.tolist()) for own in lines))

    @cached_property
    def bearing_power(self) -> FloatArray:
        """Power of each bearing channel, (n, 2, n_used)."""
        return np.ascontiguousarray(own_power(self.bearing))

    @cached_property
    def _gram(self) -> FloatArray:
        """Real parts of the products of (u_1, u_2, iω u_1, iω u_2), (n, 16, n_used)."""
        scale, (n, n_used) = self.ratio[:, np.newaxis, np.newaxis], self.ratio.shape
        gram = np.empty((n, N_UNKNOWNS, N_UNKNOWNS, n_used))
        gram[:, :2, :2] = self.shaft.real
        np.multiply(scale, self.shaft.imag, out=gram[:, :2, 2:])
        np.negative(gram[:, :2, 2:], out=gram[:, 2:, :2])
        np.multiply(scale**2, gram[:, :2, :2], out=gram[:, 2:, 2:])
        return gram.reshape(n, -1, n_used)

    @cached_property
    def _noise(self) -> FloatArray:
        """Diagonal of the products of the probes' noise, (n, 4, n_used)."""
        noise = np.ones_like(self.ratio)[:, np.newaxis] * self.noise_power[..., np.newaxis]
        return np.concatenate([noise, self.ratio[:, np.newaxis] ** 2 * noise], axis=1)

    def normal(self, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the normal equations of both rows, (n, 2, 4, 4), and the least share of motion.

        The share, (n,), is the smallest fraction of motion in the weighted shaft spectra of any
        direction of motion, for the worse row. The weights are (n, 2, n_used).
        """
        whole = (weight @ self._gram.swapaxes(1, 2)).reshape(-1, 2, N_UNKNOWNS, N_UNKNOWNS)
        noise = weight @ self._noise.swapaxes(1, 2)
        share = 1.0 - _largest_share(noise[..., :2], whole[..., :2, :2]).max(axis=1)
        np.einsum("...ii->...i", whole)[...] -= noise
        return whole, share

    def moments(self, weight: FloatArray, stiffness_n_per_m: ComplexArray) -> FloatArray:
        """Return moments of the shaft's motion with the force of brackets, (n, 2, 4, n_brackets).

        `stiffness_n_per_m` holds the dynamic stiffnesses of the brackets, (n, n_brackets, n_used).
        """
        weighted = weight[:, :, np.newaxis] * self.cross
        scaled = np.concatenate([weighted, self.ratio[:, np.newaxis, np.newaxis] * weighted], 2)
        summed = scaled @ stiffness_n_per_m[:, np.newaxis].swapaxes(-1, -2)
        return np.concatenate([summed[:, :, :2].real, summed[:, :, 2:].imag], axis=2)

    def force_moments(self, stiffness_n_per_m: ComplexArray) -> FloatArray:
        """Return the moments of the force of one bracket at each line, (n, 2, 4, n_used)."""
        force = stiffness_n_per_m[:, np.newaxis, np.newaxis] * self.cross
        scaled = self.ratio[:, np.newaxis, np.newaxis] * force.imag
        return np.concatenate([force.real, scaled], axis=2)

    def modelled_power(self, unknowns: FloatArray) -> FloatArray:
        """Return the power of the film's force for (n, 2, 4) unknowns, (n, 2, n_used)."""
        squares = unknowns[..., np.newaxis] * unknowns[..., np.newaxis, :]
        power: FloatArray = squares.reshape(-1, 2, N_UNKNOWNS**2) @ self._gram
        return power

    def film(self, unknowns: FloatArray) -> ComplexArray:
        """Return the dynamic stiffness of films, (n, ..., 2, n_used), of (n, ..., 4) unknowns."""
        ratio = self.ratio.reshape(len(self.ratio), *(1,) * (unknowns.ndim - 1), -1)
        film = np.empty((*unknowns.shape[:-1], 2, ratio.shape[-1]), dtype=np.complex128)
        film.real = unknowns[..., :2, np.newaxis]
        film.imag = ratio * unknowns[..., 2:, np.newaxis]
        return film

    def smoothed(self, power: FloatArray) -> FloatArray:
        """Return power spectra (n, n_spectra, n_used), smoothed by regression of the logarithm."""
        smooth: FloatArray = np.exp(np.log(power) @ self.smoothing)
        return smooth


def _largest_share(part: FloatArray, whole: FloatArray) -> FloatArray:
    """Return the largest ratio of two quadratic forms; 1 if the second is singular.

    Parameters
    ----------
    part : (..., 2)
        Diagonal of the first, which is diagonal.
    whole : (..., 2, 2)
        Second, symmetric.
    """
    x, y = whole[..., 0, 0], whole[..., 1, 1]
    determinant = x * y - whole[..., 0, 1] ** 2
    singular = ~(determinant > ROUNDING * x * y)
    # largest root of det(part - share · whole) = 0
    mixed = part[..., 0] * y + part[..., 1] * x
    left = part[..., 0] * part[..., 1]
    root = np.sqrt(np.maximum(mixed**2 - 4.0 * determinant * left, 0.0))
    return np.where(singular, 1.0, (mixed + root) / np.where(singular, 1.0, 2.0 * determinant))


def line_weights(
    lines: FilmLines, stiffness_n_per_m: ComplexArray
) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Return the weights of the lines: reciprocals of the smoothed residual power.

    Fit and weights are iterated. The first weights are the reciprocals of the bearing's power that
    is incoherent with the shaft, times the coherence.

    Parameters
    ----------
    stiffness_n_per_m : (n, n_used)
        Dynamic stiffness of the brackets.

    Returns
    -------
    Weights, (n, 2, n_used); and a mask, (n,), of the bearings in which the fraction of motion in
    the shaft spectra was at least `MIN_SHARE` throughout.
    """
    power = np.abs(stiffness_n_per_m[:, np.newaxis]) ** 2 * lines.bearing_power
    force, least = lines.force_moments(stiffness_n_per_m), ROUNDING * power
    rest = conditional_power(lines.bearing, lines.shaft, lines.cross) / lines.bearing_power
    weight = lines.counted * (1.0 - rest) / lines.smoothed(np.maximum(power * rest, least))
    normal, share = lines.normal(weight)
    moves = share >= MIN_SHARE
    for _ in range(N_ITERATIONS):
        if not moves.any():
            break
        normal[~moves] = np.eye(N_UNKNOWNS)
        moment = force @ weight[..., np.newaxis]
        unknowns = np.asarray(np.linalg.solve(normal, moment)[..., 0], dtype=np.float64)
        common = (unknowns[..., np.newaxis, :] @ force)[..., 0, :]
        residual = power - 2.0 * common + lines.modelled_power(unknowns)
        weight = lines.counted / lines.smoothed(np.maximum(residual, least))
        normal, share = lines.normal(weight)
        moves &= share >= MIN_SHARE
    return weight, moves


@lru_cache(maxsize=32)
def smoother(lines: tuple[tuple[int, ...], ...]) -> FloatArray:
    """Return matrices of a local linear regression over neighbouring lines, (n, n_used, n_used).

    A row of spectra times the matrix is the smoothed row. `lines` are the bin indices by bearing.
    """
    n_used = max(map(len, lines))
    matrices = np.zeros((len(lines), n_used, n_used))
    for matrix, own in zip(matrices, lines, strict=True):
        distance = np.subtract.outer(np.array(own), np.array(own)).astype(np.float64)
        near = (np.abs(distance) <= SMOOTHING_REACH_BINS).astype(np.float64)
        count, first = near.sum(axis=1), (near * distance).sum(axis=1)
        second = (near * distance**2).sum(axis=1)
        alone = count * second == first**2  # a line without neighbours is not smoothed
        determinant = np.where(alone, 1.0, count * second - first**2)
        sloped = near * (second[:, np.newaxis] - first[:, np.newaxis] * distance)
        found = np.where(alone[:, np.newaxis], np.eye(len(own)), sloped)
        matrix[: len(own), : len(own)] = (found / determinant[:, np.newaxis]).T
    matrices.setflags(write=False)
    return matrices
