"""Fitting a film's eight coefficients to averaged spectra by weighted least squares.

Row i of ``z_b V = (K + iωC) U`` asks for four real numbers (k_i1, k_i2, c_i1, c_i2) that minimise
``Σ_lines w Σ_segments |z_b v_i - Σ_j (k_ij + iω c_ij) u_j|²``. Written out, the sums over segments
are the entries of the cross-spectrum matrix, so that no segment is needed a second time.
"""

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt

from core.arrays import ComplexArray, FloatArray
from core.spectra.cross_spectrum import BEARING_X, CORRELATED_LINES, CrossSpectrum
from core.stiffness.dynamic_lines import conditional_power

MIN_SHARE = 0.05
"""Below this share of motion in the shaft spectra their noise-free part may not be invertible."""

ROUNDING = 1e-12
"""Relative power that signals without noise leave over."""


N_UNKNOWNS = 4


@dataclass(frozen=True)
class NormalEquations:
    """The sums of every line; stiffness in N/m, damping times `omega_unit` in N/m.

    Parameters
    ----------
    gram : (n_lines, 4, 4)
        Of the shaft motion, its noise included.
    noise_gram : (n_lines, 4, 4)
        Share of the probes' noise in it.
    force : (n_lines, 2, 4)
        Shaft motion times force of the bracket, for each row.
    force_power : (n_lines, 2)
    shaft, cross : (n_lines, 2, 2)
        Spectra of the shaft's motion, its noise included, and of bearing times conjugated shaft.
    noise_power : (2,)
        Mean squared phasor of each probe's noise.
    bracket_n_per_m : (n_lines,)
        Dynamic stiffness of the bracket.
    ratio : (n_lines,)
        Angular frequency over `omega_unit`.
    omega_unit
        Damping is counted in N/m at this angular frequency, to be as large as stiffness.
    """

    gram: FloatArray
    noise_gram: FloatArray
    force: FloatArray
    force_power: FloatArray
    shaft: ComplexArray
    cross: ComplexArray
    noise_power: FloatArray
    bracket_n_per_m: ComplexArray
    ratio: FloatArray
    omega_unit: float

    @cached_property
    def true_gram(self) -> FloatArray:
        """Gram matrix of the motion without the probes' noise."""
        return self.gram - self.noise_gram

    def solve(self, weight: FloatArray, right: FloatArray) -> FloatArray:
        """Unknowns of both rows, (..., 2, 4).

        Parameters
        ----------
        weight : (n_lines, 2)
        right : (..., n_lines, 2, 4)
            `force`, or moments.
        """
        left = _weighted(weight, self.true_gram)
        moment = (weight[..., np.newaxis] * right).sum(axis=-3)
        unknowns: FloatArray = np.linalg.solve(left, moment[..., np.newaxis])[..., 0]
        return unknowns

    def residual(self, unknowns: FloatArray) -> FloatArray:
        """Power of the force that is left over, (n_lines, 2) in (N/m)² µm²."""
        squares = np.einsum("ra,rb->rab", unknowns, unknowns).reshape(2, -1)
        modelled = self.gram.reshape(-1, N_UNKNOWNS**2) @ squares.T
        common = np.einsum("lra,ra->lr", self.force, unknowns)
        left: FloatArray = self.force_power - 2.0 * common + modelled
        return np.maximum(left, 0.0)

    def inverse(self, weight: FloatArray) -> FloatArray:
        """Inverse of the weighted Gram matrix of the motion, for each row, (2, 4, 4)."""
        return np.asarray(np.linalg.inv(_weighted(weight, self.true_gram)), dtype=np.float64)

    def moment(self, stiffness_n_per_m: ComplexArray) -> FloatArray:
        """Shaft motion times the force of a bracket of another dynamic stiffness, (n_lines, 2, 4).

        Parameters
        ----------
        stiffness_n_per_m : (n_lines,)
        """
        return _moment(stiffness_n_per_m[:, np.newaxis, np.newaxis] * self.cross, self.ratio)

    def film(self, unknowns: FloatArray) -> ComplexArray:
        """Dynamic stiffness of a film at the lines, (n_lines, 2, 2)."""
        damping = self.ratio[:, np.newaxis, np.newaxis] * unknowns[:, 2:]
        film: ComplexArray = unknowns[:, :2] + 1j * damping
        return film

    @cached_property
    def regressors(self) -> ComplexArray:
        """What the unknowns of a row multiply, by shaft motion, (n_lines, 4, 2)."""
        regressors = np.zeros((self.ratio.size, N_UNKNOWNS, 2), dtype=np.complex128)
        regressors[:, (0, 1), (0, 1)] = 1.0
        regressors[:, (2, 3), (0, 1)] = 1j * self.ratio[:, np.newaxis]
        return regressors


def normal_equations(
    spectrum: CrossSpectrum,
    lines: npt.NDArray[np.int64],
    bracket_n_per_m: ComplexArray,
    noise_power: FloatArray,
) -> NormalEquations:
    """Sum up the lines of a spectrum.

    Parameters
    ----------
    lines
        Indices of the lines used.
    bracket_n_per_m : (n_used,)
        Dynamic stiffness of the bracket at these.
    noise_power : (2,)
        Mean squared phasor of each probe's noise.
    """
    matrix = spectrum.matrix[lines]
    omega = 2.0 * np.pi * spectrum.frequency_hz[lines]
    omega_unit = float(omega.mean())
    shaft = matrix[:, :BEARING_X, :BEARING_X]
    cross = matrix[:, BEARING_X:, :BEARING_X]  # bearing times conjugated shaft
    power = np.diagonal(matrix[:, BEARING_X:, BEARING_X:], axis1=1, axis2=2).real
    ratio = omega / omega_unit
    return NormalEquations(
        gram=_gram(shaft, ratio),
        noise_gram=_noise_gram(noise_power, ratio),
        force=_moment(bracket_n_per_m[:, np.newaxis, np.newaxis] * cross, ratio),
        force_power=np.abs(bracket_n_per_m[:, np.newaxis]) ** 2 * power,
        shaft=shaft,
        cross=cross,
        noise_power=noise_power,
        bracket_n_per_m=bracket_n_per_m,
        ratio=ratio,
        omega_unit=omega_unit,
    )


def _gram(shaft: ComplexArray, ratio: FloatArray) -> FloatArray:
    """Real parts of the products of (u_1, u_2, iω u_1, iω u_2), (n_lines, 4, 4)."""
    scale = ratio[:, np.newaxis, np.newaxis]
    gram = np.empty((shaft.shape[0], N_UNKNOWNS, N_UNKNOWNS))
    gram[:, :2, :2] = shaft.real
    gram[:, :2, 2:] = scale * shaft.imag
    gram[:, 2:, :2] = -gram[:, :2, 2:]
    gram[:, 2:, 2:] = scale**2 * shaft.real
    return gram


def _noise_gram(noise_power: FloatArray, ratio: FloatArray) -> FloatArray:
    """The same of independent noises of the probes."""
    gram = np.zeros((ratio.size, N_UNKNOWNS, N_UNKNOWNS))
    gram[:, (0, 1), (0, 1)] = noise_power
    gram[:, (2, 3), (2, 3)] = ratio[:, np.newaxis] ** 2 * noise_power
    return gram


def _moment(cross: ComplexArray, ratio: FloatArray) -> FloatArray:
    """Real parts of force times (u_1, u_2, iω u_1, iω u_2), (n_lines, 2, 4)."""
    scale = ratio[:, np.newaxis, np.newaxis]
    return np.concatenate([cross.real, scale * cross.imag], axis=2)


def _weighted(weight: FloatArray, matrices: FloatArray) -> FloatArray:
    """Sum over lines for each row, (2, 4, 4)."""
    summed = weight.T @ matrices.reshape(matrices.shape[0], -1)
    return summed.reshape(-1, N_UNKNOWNS, N_UNKNOWNS)


def line_weights(
    equations: NormalEquations, matrix: ComplexArray, smoothing: FloatArray, n_iterations: int
) -> FloatArray | None:
    """Reciprocal residual spectra, (n_lines, 2), fitted in turn with the film.

    The fit starts from what any response to the shaft would leave, weighted by coherence.

    Parameters
    ----------
    matrix : (n_lines, 4, 4)
        The cross-spectra of the lines.
    smoothing : (n_lines, n_lines)
        From `smoother`.

    Returns
    -------
    None if the shaft hardly moves.
    """
    shaft, bearing = slice(0, BEARING_X), slice(BEARING_X, None)
    power = np.diagonal(matrix, axis1=1, axis2=2).real[:, bearing]
    rest = conditional_power(
        matrix[:, bearing, bearing], matrix[:, shaft, shaft], matrix[:, bearing, shaft]
    )
    coherence = 1.0 - rest / power
    residual = equations.force_power * (1.0 - coherence)
    weight = coherence / _smoothed(smoothing, residual, equations.force_power)
    for _ in range(n_iterations):
        if signal_share(equations, weight) < MIN_SHARE:
            return None
        residual = equations.residual(equations.solve(weight, equations.force))
        weight = 1.0 / _smoothed(smoothing, residual, equations.force_power)
    return weight if signal_share(equations, weight) >= MIN_SHARE else None


def signal_share(equations: NormalEquations, weight: FloatArray) -> float:
    """Smallest share of motion in the weighted shaft spectra, over directions and rows."""
    n_lines = weight.shape[0]
    motion = equations.gram[:, :2, :2].reshape(n_lines, 4)
    noise = equations.noise_gram[:, :2, :2].reshape(n_lines, 4)
    return min(
        1.0 - _largest_share(*shares)
        for shares in zip(weight.T @ noise, weight.T @ motion, strict=True)
    )


def _largest_share(part: FloatArray, whole: FloatArray) -> float:
    """Largest part in any direction of the whole, two symmetric (2, 2) matrices laid out flat."""
    determinant = float(whole[0] * whole[3] - whole[1] ** 2)
    if not determinant > ROUNDING * float(whole[0] * whole[3]):
        return 1.0
    # largest root of det(part - share · whole) = 0
    mixed = float(part[0] * whole[3] + part[3] * whole[0] - 2.0 * part[1] * whole[1])
    left = float(part[0] * part[3] - part[1] ** 2)
    root = math.sqrt(max(mixed**2 - 4.0 * determinant * left, 0.0))
    return (mixed + root) / (2.0 * determinant)


@lru_cache(maxsize=32)
def smoother(lines: tuple[int, ...], reach: int) -> FloatArray:
    """Matrix that puts a straight line through the neighbours of each line, (n_lines, n_lines).

    Parameters
    ----------
    lines
        Indices of the lines; those further than `reach` bins apart are no neighbours.
    """
    distance = np.subtract.outer(np.array(lines), np.array(lines)).astype(np.float64)
    near = (np.abs(distance) <= reach).astype(np.float64)
    count, first = near.sum(axis=1), (near * distance).sum(axis=1)
    second = (near * distance**2).sum(axis=1)
    alone = count * second == first**2  # a line without neighbours keeps what it has
    determinant = np.where(alone, 1.0, count * second - first**2)
    sloped = near * (second[:, np.newaxis] - first[:, np.newaxis] * distance)
    matrix: FloatArray = np.where(alone[:, np.newaxis], np.eye(len(lines)), sloped)
    matrix /= determinant[:, np.newaxis]
    matrix.setflags(write=False)
    return matrix


def _smoothed(smoothing: FloatArray, residual: FloatArray, force_power: FloatArray) -> FloatArray:
    """Straight lines through the logarithm: the spectra of transducer noise are steep."""
    smooth: FloatArray = np.exp(smoothing @ np.log(np.maximum(residual, ROUNDING * force_power)))
    return smooth


def explained_share(
    weight: FloatArray, residual: FloatArray, force_power: FloatArray
) -> FloatArray:
    """Share of each bearing channel's weighted power that the film explains, (2,), 0 to 1."""
    whole = (weight * force_power).sum(axis=0)
    share: FloatArray = 1.0 - (weight * residual).sum(axis=0) / whole
    return np.minimum(np.maximum(share, 0.0), 1.0)


def coherence_segments(
    weight: FloatArray,
    residual: FloatArray,
    force_power: FloatArray,
    smoothing: FloatArray,
    n_segments: float,
) -> FloatArray:
    """Segments by which one line's coherence would be as certain as that of all lines, (2,).

    The share that is left, residual over whole, moves with the relative errors of each line's
    residual and power, ``1 / √n`` each and common to both as far as the residual is all of it. The
    residual moves it a second time through the weights.
    """
    left = weight * residual / (weight * residual).sum(axis=0)
    whole = weight * force_power / (weight * force_power).sum(axis=0)
    moves = left + smoothing.T @ (whole - left)
    squares = (moves**2 + whole**2 - 2.0 * moves * whole * residual / force_power).sum(axis=0)
    variance = CORRELATED_LINES * squares / (n_segments - 2.0)  # two fitted signals
    found: FloatArray = 1.0 + 2.0 * explained_share(weight, residual, force_power) / variance
    return found


def lack_of_fit(
    equations: NormalEquations, unknowns: FloatArray, weight: FloatArray, n_segments: float
) -> FloatArray:
    """How much the residual still has in common with the shaft's motion, (2,).

    Its mean is 1 if stiffness and damping are constant over the lines: the residual is then as
    little correlated with the shaft as `n_segments` independent segments let it be.
    """
    # moments of the residual with (u_1, u_2, iω u_1, iω u_2): real part, then ratio × imaginary
    left = equations.force - np.einsum("lab,rb->lra", equations.true_gram, unknowns)
    residual = equations.residual(unknowns)
    ratio = equations.ratio
    common = left[..., :2] + 1j * left[..., 2:] / ratio[:, np.newaxis, np.newaxis]
    shaft = equations.gram[:, :2, :2] + 1j * equations.gram[:, :2, 2:] / ratio[:, None, None]
    scaled = np.linalg.solve(shaft.transpose(0, 2, 1), common.transpose(0, 2, 1))
    power = (common.transpose(0, 2, 1).conj() * scaled).sum(axis=1).real
    whole = (weight * residual).sum(axis=0)
    found: FloatArray = n_segments * (weight * power).sum(axis=0) / (2.0 * whole)
    return found
