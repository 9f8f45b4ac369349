"""Weighted least-squares fit of the films of several bearings to their averaged cross-spectra.

For row i of ``z_b V = (K + iωC) U``, four real numbers (k_i1, k_i2, c_i1, c_i2) minimise
``Σ_lines w Σ_segments |z_b v_i - Σ_j (k_ij + iω c_ij) u_j|²``. The sums over segments are entries
of the cross-spectrum matrix; the segments themselves are not needed.

Bearing comes first in all arrays, line last, so that each step is one operation for all bearings.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt

from core.arrays import BoolArray, ComplexArray, FloatArray, IntArray
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

N_FUNCTIONS = 4
"""Number of functions of frequency in a film: 1, iω, the shape of a lag, and its derivative."""

_PAIRS = [(a, b) for b in range(N_FUNCTIONS) for a in range(b + 1)]

PAIRS: npt.NDArray[np.intp] = np.array(_PAIRS).T
"""Pairs of functions, (2, 10), ordered by the second: those of fewer functions come first."""

N_PRODUCTS = 5
"""Number of products of a pair of functions: with xx, xy, yx and yy of the shaft, and without."""

_DIRECTIONS = (*np.ndindex(2, 2), (0, 0))

FACTORS: npt.NDArray[np.intp] = np.array(
    [(2 * a + j, 2 * b + k) for a, b in _PAIRS for j, k in _DIRECTIONS]
).T
"""Coefficients that are factors of each product in the power of a film's force, (2, 50)."""

MULTIPLES: FloatArray = np.array([[2.0 - (a == b)] * 4 + [0.0] for a, b in _PAIRS]).ravel()
"""How often each product occurs in the power of a film's force, (50,)."""

PLACES: npt.NDArray[np.intp] = np.zeros((2 * N_FUNCTIONS,) * 2, dtype=np.intp)
"""Indices of the products in the normal equations, (8, 8)."""

for _place, (_row, _column, _multiple) in enumerate(zip(*FACTORS, MULTIPLES, strict=True)):
    if _multiple:
        PLACES[_row, _column] = PLACES[_column, _row] = _place


class FilmLines:
    """Cross-spectra at the used lines of n bearings.

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
        lines: Sequence[IntArray],
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
    def motion(self) -> ComplexArray:
        """Cross-spectra of the shaft's motion without the probes' noise, (n, 2, 2, n_used)."""
        motion = self.shaft.copy()
        np.einsum("niil->nil", motion)[...] -= self.noise_power[..., np.newaxis]
        return motion

    @cached_property
    def shaft_root(self) -> ComplexArray:
        """Hermitian square roots of the shaft's cross-spectra, (n, 2, 2, n_used)."""
        own = own_power(self.shaft)
        determinant = own[:, 0] * own[:, 1] - np.abs(self.shaft[:, 0, 1]) ** 2
        root = np.sqrt(np.maximum(determinant, 0.0))
        # closed form of the 2 × 2 square root, by the theorem of Cayley and Hamilton
        whole = self.shaft.copy()
        np.einsum("niil->nil", whole)[...] += root[:, np.newaxis]
        whole /= np.sqrt(own.sum(axis=1) + 2.0 * root)[:, np.newaxis, np.newaxis]
        return whole

    @cached_property
    def smooth_shaft_root(self) -> ComplexArray:
        """Hermitian square roots of the smoothed shaft motion's spectra, (n, 2, 2, n_used)."""
        power = own_power(self.shaft)
        scale = np.sqrt(self.smoothed(power) / power)
        return np.asarray(scale[:, :, np.newaxis] * self.shaft_root)

    def smoothed(self, power: FloatArray) -> FloatArray:
        """Return power spectra (n, n_spectra, n_used), smoothed by regression of the logarithm."""
        return np.asarray(np.exp(np.log(power) @ self.smoothing))


class FilmTerms:
    """Products of the terms of films at each line, for the normal equations of the fits.

    The force of a row is a sum of terms ``θ φ(ω) u`` with real coefficients θ, functions φ, and the
    shaft's motion u in x and y. The p coefficients are ordered by function, then by motion; they
    are those of the first `n_functions` functions where this number is given.

    Parameters
    ----------
    functions : (n, 1, 4, n_used) or (n, 2, 4, n_used)
        Functions of both rows, or of each; the first are 1 and iω over `omega_unit`.
    force : (n, 2, 2, n_used)
        Cross-spectra of the brackets' forces with the shaft's (conjugated) motion.
    """

    def __init__(self, lines: FilmLines, functions: ComplexArray, force: ComplexArray) -> None:
        self.lines, self.functions = lines, functions
        n, n_rows, _, n_used = functions.shape
        pairs = functions[:, :, PAIRS[0]].conj() * functions[:, :, PAIRS[1]]
        shaft = lines.shaft.reshape(n, 1, 1, 4, n_used)
        products = np.empty((n, n_rows, pairs.shape[2], N_PRODUCTS, n_used))
        np.multiply(pairs.real[..., np.newaxis, :], shaft.real, out=products[..., :4, :])
        products[..., :4, :] += pairs.imag[..., np.newaxis, :] * shaft.imag
        products[..., 4, :] = pairs.real
        self._products = products.reshape(n, n_rows, -1, n_used)
        with_force = functions[:, :, :, np.newaxis].conj() * force[:, :, np.newaxis]
        self._moments = with_force.real.reshape(n, 2, -1, n_used)

    def normal(
        self, weight: FloatArray, n_functions: int = N_FUNCTIONS
    ) -> tuple[FloatArray, FloatArray]:
        """Return the normal equations of both rows, (n, 2, p, p), and the least share of motion.

        The share, (n,), is the smallest fraction of motion, as opposed to noise, in the weighted
        shaft spectra of any direction, for the worse row. Below `MIN_SHARE` the equations may be
        singular and are replaced by the identity. `weight` is (n, 2, n_used).
        """
        n_products = N_PRODUCTS * n_functions * (n_functions + 1) // 2
        summed = (self._products[:, :, :n_products] @ weight[..., np.newaxis])[..., 0]
        by_pair = summed.reshape(*summed.shape[:2], -1, N_PRODUCTS)
        noise = by_pair[..., 4:] * self.lines.noise_power[:, np.newaxis, np.newaxis]
        share = 1.0 - _largest_share(noise[:, :, 0], by_pair[:, :, 0, :4]).max(axis=1)
        by_pair[..., :4:3] -= noise
        normal = summed[..., PLACES[: 2 * n_functions, : 2 * n_functions]]
        singular = ~(share >= MIN_SHARE)
        if singular.any():
            normal[singular] = np.eye(2 * n_functions)
        return normal, share

    def moments(self, weight: FloatArray, n_functions: int = N_FUNCTIONS) -> FloatArray:
        """Return the weighted sums over lines of each term times the bracket's force, (n, 2, p)."""
        summed: FloatArray = self._moments[:, :, : 2 * n_functions] @ weight[..., np.newaxis]
        return summed[..., 0]

    def residual(self, power: FloatArray, coefficients: FloatArray) -> FloatArray:
        """Return the power of the residual force of films, (n, 2, n_used).

        `power` (n, 2, n_used) is the power of the brackets' forces; `coefficients` are (n, 2, p).
        """
        n_functions = coefficients.shape[-1] // 2
        n_products = N_PRODUCTS * n_functions * (n_functions + 1) // 2
        first, second = FACTORS[:, :n_products]
        squares = coefficients[..., first] * coefficients[..., second] * MULTIPLES[:n_products]
        modelled = squares[:, :, np.newaxis] @ self._products[:, :, :n_products]
        common = coefficients[:, :, np.newaxis] @ self._moments[:, :, : 2 * n_functions]
        left: FloatArray = power - 2.0 * common[:, :, 0] + modelled[:, :, 0]
        return np.maximum(left, 0.0)


@dataclass(frozen=True)
class WeightedTerms:
    """Terms of films with the weights of the lines, (n, 2, n_used), and their sums over lines."""

    terms: FilmTerms
    weight: FloatArray

    @cached_property
    def _normal(self) -> tuple[FloatArray, FloatArray]:
        return self.terms.normal(self.weight)

    @property
    def normal(self) -> FloatArray:
        """Normal equations of both rows, (n, 2, 8, 8)."""
        return self._normal[0]

    @property
    def signal_share(self) -> FloatArray:
        """Smallest fraction of motion (not noise) in the weighted shaft spectra, (n,)."""
        return self._normal[1]

    @cached_property
    def moments(self) -> FloatArray:
        """Weighted sums over lines of each term times the bracket's force, (n, 2, 8)."""
        return self.terms.moments(self.weight)

    @cached_property
    def _right(self) -> FloatArray:
        """Moments, and normal equations by the lagging terms, (n, 2, 8, 5)."""
        return np.concatenate([self.moments[..., np.newaxis], self.normal[..., N_UNKNOWNS:]], 3)

    @cached_property
    def solved(self) -> FloatArray:
        """Unknowns without lagging terms, and their negative derivatives by these, (n, 2, 4, 5)."""
        normal = self.normal[..., :N_UNKNOWNS, :N_UNKNOWNS]
        return np.asarray(np.linalg.solve(normal, self._right[..., :N_UNKNOWNS, :]), np.float64)

    @cached_property
    def reduced(self) -> FloatArray:
        """Moments and normal equations of the lagging terms beside the unknowns, (n, 2, 4, 5)."""
        to_unknowns = self.normal[..., N_UNKNOWNS:, :N_UNKNOWNS]
        return np.asarray(self._right[..., N_UNKNOWNS:, :] - to_unknowns @ self.solved)


def _largest_share(part: FloatArray, whole: FloatArray) -> FloatArray:
    """Return the largest ratio of two quadratic forms; 1 if the second is singular.

    Parameters
    ----------
    part : (..., 2)
        Diagonal of the first, which is diagonal.
    whole : (..., 4)
        Second, symmetric: xx, xy, yx and yy.
    """
    x, y = whole[..., 0], whole[..., 3]
    product = x * y
    determinant = product - whole[..., 1] ** 2
    singular = ~(determinant > ROUNDING * product)
    # largest root of det(part - share · whole) = 0
    mixed = part[..., 0] * y + part[..., 1] * x
    left = part[..., 0] * part[..., 1]
    root = np.sqrt(np.maximum(mixed**2 - 4.0 * determinant * left, 0.0))
    return np.where(singular, 1.0, (mixed + root) / np.where(singular, 1.0, 2.0 * determinant))


def line_weights(terms: FilmTerms, force_power: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the weights of the lines: reciprocals of the smoothed residual power.

    Fit of constant coefficients and weights are iterated. The first weights are the reciprocals of
    the bearing's power that is incoherent with the shaft, times the coherence.

    `force_power` (n, 2, n_used) is the power of the brackets' forces, `terms` are the terms of the
    films at the lines.

    Returns
    -------
    Weights, (n, 2, n_used); and a mask, (n,), of the bearings in which the fraction of motion in
    the shaft spectra was at least `MIN_SHARE` throughout.
    """
    lines, least = terms.lines, ROUNDING * force_power
    rest = conditional_power(lines.bearing, lines.shaft, lines.cross) / lines.bearing_power
    smooth = lines.smoothed(np.maximum(force_power * rest, least))
    weight = lines.counted * (1.0 - rest) / smooth
    normal, share = terms.normal(weight, 2)
    moves = share >= MIN_SHARE
    for _ in range(N_ITERATIONS):
        if not moves.any():
            break
        moments = terms.moments(weight, 2)[..., np.newaxis]
        unknowns = np.asarray(np.linalg.solve(normal, moments)[..., 0], dtype=np.float64)
        residual = terms.residual(force_power, unknowns)
        weight = lines.counted / lines.smoothed(np.maximum(residual, least))
        normal, share = terms.normal(weight, 2)
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
