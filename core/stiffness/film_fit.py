"""Fitting a film to spectra: weights from the residual, evidence, and whether the model holds."""

import math
from functools import lru_cache

import numpy as np

from core.arrays import ComplexArray, FloatArray
from core.spectra.cross_spectrum import BEARING_X
from core.spectra.spectral_statistics import CORRELATED_LINES
from core.stiffness.normal_equations import NormalEquations
from core.stiffness.probe_noise import conditional_power

LEAST_SHARE = 0.05
"""Below this share of motion in the shaft spectra their noise-free part may not be invertible."""

ROUNDING = 1e-12
"""Relative power that signals without noise leave over."""


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
        if signal_share(equations, weight) < LEAST_SHARE:
            return None
        residual = equations.residual(equations.solve(weight, equations.force))
        weight = 1.0 / _smoothed(smoothing, residual, equations.force_power)
    return weight if signal_share(equations, weight) >= LEAST_SHARE else None


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
