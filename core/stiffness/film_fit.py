"""Weighted least-squares fit of a film's eight coefficients to averaged cross-spectra.

For row i of ``z_b V = (K + iωC) U``, four real numbers (k_i1, k_i2, c_i1, c_i2) minimise
``Σ_lines w Σ_segments |z_b v_i - Σ_j (k_ij + iω c_ij) u_j|²``. The sums over segments are entries
of the cross-spectrum matrix; the segments themselves are not needed.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from core.arrays import ComplexArray, FloatArray
from core.spectra.cross_spectrum import BEARING_X
from core.stiffness.dynamic_lines import conditional_power

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


@dataclass(frozen=True)
class NormalEquations:
    """Normal equations of the fit at each line.

    The unknowns are stiffness and damping times `omega_unit`, both in N/m.

    Parameters
    ----------
    matrix : (n_lines, 4, 4)
        Cross-spectra of (u_x, u_y, v_x, v_y) at the used lines.
    omega : (n_lines,)
        Angular frequencies of the lines.
    bracket_n_per_m : (n_lines,)
        Dynamic stiffness of the bracket.
    noise_power : (2,)
        Mean squared phasor of each probe's noise.
    """

    matrix: ComplexArray
    omega: FloatArray
    bracket_n_per_m: ComplexArray
    noise_power: FloatArray

    @cached_property
    def omega_unit(self) -> float:
        """Angular frequency that scales damping to N/m, comparable with stiffness."""
        return float(self.omega.mean())

    @cached_property
    def ratio(self) -> FloatArray:
        """Angular frequencies over `omega_unit`, (n_lines,)."""
        return self.omega / self.omega_unit

    @property
    def shaft(self) -> ComplexArray:
        """Cross-spectra of the shaft's motion including noise, (n_lines, 2, 2)."""
        return self.matrix[:, :BEARING_X, :BEARING_X]

    @property
    def cross(self) -> ComplexArray:
        """Cross-spectra of the bearing's with the shaft's (conjugated) motion, (n_lines, 2, 2)."""
        return self.matrix[:, BEARING_X:, :BEARING_X]

    @cached_property
    def gram(self) -> FloatArray:
        """Gram matrix of the shaft's motion including noise, (n_lines, 4, 4)."""
        return _gram(self.shaft, self.ratio)

    @cached_property
    def noise_gram(self) -> FloatArray:
        """Gram matrix of the probes' noise, which is independent in x and y, (n_lines, 4, 4)."""
        return _gram(np.diag(self.noise_power).astype(np.complex128), self.ratio)

    @cached_property
    def true_gram(self) -> FloatArray:
        """Gram matrix of the shaft's motion without the probes' noise, (n_lines, 4, 4)."""
        return self.gram - self.noise_gram

    @cached_property
    def force(self) -> FloatArray:
        """Moments of the shaft's motion with the bracket's force, for each row, (n_lines, 2, 4)."""
        return self.moment(self.bracket_n_per_m)

    @cached_property
    def force_power(self) -> FloatArray:
        """Power of the bracket's force in (N/m)² µm², for each row, (n_lines, 2)."""
        bearing = self.matrix[:, BEARING_X:, BEARING_X:]
        power = np.diagonal(bearing, axis1=1, axis2=2).real
        return np.asarray(np.abs(self.bracket_n_per_m[:, np.newaxis]) ** 2 * power)

    def moment(self, stiffness_n_per_m: ComplexArray) -> FloatArray:
        """Return the moments (..., n_lines, 2, 4) of the shaft's motion with the force of brackets.

        `stiffness_n_per_m` holds the dynamic stiffnesses of the brackets, (..., n_lines).
        """
        cross = stiffness_n_per_m[..., np.newaxis, np.newaxis] * self.cross
        scale = self.ratio[:, np.newaxis, np.newaxis]
        return np.concatenate([cross.real, scale * cross.imag], axis=-1)

    def solve(self, weight: FloatArray, right: FloatArray) -> FloatArray:
        """Return the unknowns of both rows that solve the normal equations, (..., 2, 4).

        Parameters
        ----------
        weight : (n_lines, 2)
        right : (..., n_lines, 2, 4)
            Right-hand side: `force`, or results of `moment`.
        """
        moment = (weight[..., np.newaxis] * right).sum(axis=-3)
        unknowns: FloatArray = np.linalg.solve(self.normal(weight), moment[..., np.newaxis])[..., 0]
        return unknowns

    def normal(self, weight: FloatArray) -> FloatArray:
        """Return the weighted sum of `true_gram` for each row, (2, 4, 4)."""
        summed = weight.T @ self.true_gram.reshape(weight.shape[0], -1)
        return summed.reshape(-1, N_UNKNOWNS, N_UNKNOWNS)

    def residual(self, unknowns: FloatArray) -> FloatArray:
        """Return the power of the residual force, (n_lines, 2) in (N/m)² µm²."""
        squares = np.einsum("ra,rb->rab", unknowns, unknowns).reshape(2, -1)
        modelled = self.gram.reshape(-1, N_UNKNOWNS**2) @ squares.T
        common = np.einsum("lra,ra->lr", self.force, unknowns)
        left: FloatArray = self.force_power - 2.0 * common + modelled
        return np.maximum(left, 0.0)

    def film(self, unknowns: FloatArray) -> ComplexArray:
        """Return the dynamic stiffness of films from (..., 2, 4) unknowns, (n_lines, ..., 2, 2)."""
        ratio = self.ratio.reshape(-1, *(1,) * unknowns.ndim)
        film: ComplexArray = unknowns[..., :2] + 1j * (ratio * unknowns[..., 2:])
        return film

    def signal_share(self, weight: FloatArray) -> float:
        """Return the smallest fraction of motion in the weighted shaft spectra of any direction."""
        noise, motion = ((weight.T @ power).tolist() for power in self._powers)
        return min(1.0 - _largest_share(*row) for row in zip(noise, motion, strict=True))

    @cached_property
    def _powers(self) -> tuple[FloatArray, FloatArray]:
        """Power of the probes' noise and of the shaft's motion with noise, each (n_lines, 4)."""
        noise, motion = (gram[:, :2, :2].reshape(-1, 4) for gram in (self.noise_gram, self.gram))
        return noise, motion


def _gram(shaft: ComplexArray, ratio: FloatArray) -> FloatArray:
    """Return the real parts of the products of (u_1, u_2, iω u_1, iω u_2), (n_lines, 4, 4)."""
    scale = ratio[:, np.newaxis, np.newaxis]
    gram = np.empty((ratio.size, N_UNKNOWNS, N_UNKNOWNS))
    gram[:, :2, :2] = shaft.real
    gram[:, :2, 2:] = scale * shaft.imag
    gram[:, 2:, :2] = -gram[:, :2, 2:]
    gram[:, 2:, 2:] = scale**2 * shaft.real
    return gram


def _largest_share(part: Sequence[float], whole: Sequence[float]) -> float:
    """Return the largest ratio of two quadratic forms, given as flat symmetric 2 × 2 matrices."""
    determinant = whole[0] * whole[3] - whole[1] ** 2
    if not determinant > ROUNDING * whole[0] * whole[3]:
        return 1.0
    # largest root of det(part - share · whole) = 0
    mixed = part[0] * whole[3] + part[3] * whole[0] - 2.0 * part[1] * whole[1]
    left = part[0] * part[3] - part[1] ** 2
    root = math.sqrt(max(mixed**2 - 4.0 * determinant * left, 0.0))
    return (mixed + root) / (2.0 * determinant)


def line_weights(equations: NormalEquations, smoothing: FloatArray) -> FloatArray | None:
    """Return the weights of the lines, (n_lines, 2): reciprocals of the smoothed residual power.

    Fit and weights are iterated. The first weights are the reciprocals of the bearing's power that
    is incoherent with the shaft, times the coherence.

    Parameters
    ----------
    smoothing : (n_lines, n_lines)
        Matrix from `smoother`.

    Returns
    -------
    None if the fraction of motion in the shaft spectra is below `MIN_SHARE`.
    """
    bearing = equations.matrix[:, BEARING_X:, BEARING_X:]
    rest = conditional_power(bearing, equations.shaft, equations.cross)
    coherence = 1.0 - rest / np.diagonal(bearing, axis1=1, axis2=2).real
    residual = equations.force_power * (1.0 - coherence)
    weight = coherence / _smoothed(smoothing, residual, equations.force_power)
    for _ in range(N_ITERATIONS):
        if equations.signal_share(weight) < MIN_SHARE:
            return None
        residual = equations.residual(equations.solve(weight, equations.force))
        weight = 1.0 / _smoothed(smoothing, residual, equations.force_power)
    return weight if equations.signal_share(weight) >= MIN_SHARE else None


@lru_cache(maxsize=32)
def smoother(lines: tuple[int, ...]) -> FloatArray:
    """Return the matrix of a local linear regression over neighbouring lines, (n_lines, n_lines).

    Parameters
    ----------
    lines
        Bin indices of the lines.
    """
    distance = np.subtract.outer(np.array(lines), np.array(lines)).astype(np.float64)
    near = (np.abs(distance) <= SMOOTHING_REACH_BINS).astype(np.float64)
    count, first = near.sum(axis=1), (near * distance).sum(axis=1)
    second = (near * distance**2).sum(axis=1)
    alone = count * second == first**2  # a line without neighbours is not smoothed
    determinant = np.where(alone, 1.0, count * second - first**2)
    sloped = near * (second[:, np.newaxis] - first[:, np.newaxis] * distance)
    matrix: FloatArray = np.where(alone[:, np.newaxis], np.eye(len(lines)), sloped)
    matrix /= determinant[:, np.newaxis]
    matrix.setflags(write=False)
    return matrix


def _smoothed(smoothing: FloatArray, residual: FloatArray, force_power: FloatArray) -> FloatArray:
    """Return the residual power, smoothed as logarithm because noise spectra are steep."""
    smooth: FloatArray = np.exp(smoothing @ np.log(np.maximum(residual, ROUNDING * force_power)))
    return smooth
