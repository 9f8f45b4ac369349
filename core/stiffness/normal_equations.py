"""Weighted least squares for a film's eight coefficients, from averaged spectra alone.

Row i of ``z_b V = (K + iωC) U`` asks for four real numbers (k_i1, k_i2, c_i1, c_i2) that minimise
``Σ_lines w Σ_segments |z_b v_i - Σ_j (k_ij + iω c_ij) u_j|²``. Written out, the sums over segments
are the entries of the cross-spectrum matrix, so that no segment is needed a second time.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from core.arrays import ComplexArray, FloatArray
from core.spectra.cross_spectrum import BEARING_X, CrossSpectrum

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
        """Unknowns of both rows, (2, 4).

        Parameters
        ----------
        weight : (n_lines, 2)
        right : (n_lines, 2, 4)
            `force`, or a `moment`.
        """
        left = _weighted(weight, self.true_gram)
        moment = np.einsum("lr,lra->ra", weight, right)
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
    noise = np.broadcast_to(np.diag(noise_power).astype(np.complex128), shaft.shape)
    return NormalEquations(
        gram=_gram(shaft, ratio),
        noise_gram=_gram(noise, ratio),
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


def _moment(cross: ComplexArray, ratio: FloatArray) -> FloatArray:
    """Real parts of force times (u_1, u_2, iω u_1, iω u_2), (n_lines, 2, 4)."""
    scale = ratio[:, np.newaxis, np.newaxis]
    return np.concatenate([cross.real, scale * cross.imag], axis=2)


def _weighted(weight: FloatArray, matrices: FloatArray) -> FloatArray:
    """Sum over lines for each row, (2, 4, 4)."""
    summed = weight.T @ matrices.reshape(matrices.shape[0], -1)
    return summed.reshape(-1, N_UNKNOWNS, N_UNKNOWNS)
