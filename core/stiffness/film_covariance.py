"""Random errors of a fitted film, and what its residual shows of the bracket and of delays.

Every estimate here is linear in ``Σ_lines w Σ_segments conj(f u) e``: e is the force that the fit
leaves over, f u a linear form of the shaft's motion, its influence on the estimate.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from core.arrays import ComplexArray, FloatArray
from core.spectra.cross_spectrum import (
    SMEARED_APART,
    SMEARED_IN_PHASE,
    SMEARED_IN_QUADRATURE,
    WHITE_PRODUCTS,
    correlated_sum,
)
from core.stiffness.film_fit import NormalEquations

_NONE = (0.0, 0.0, 0.0)

PART_PRODUCTS: FloatArray = np.array(
    [
        *[WHITE_PRODUCTS] * 4,  # residual with the shaft's motion
        SMEARED_IN_PHASE,
        SMEARED_IN_QUADRATURE,
        *[SMEARED_APART] * 4,
        WHITE_PRODUCTS,  # the probes' noise in both
        _NONE,
    ]
).T
"""Correlation of real and imaginary parts of `FilmFit._parts` 0, 1 and 2 bins apart, (3, 12)."""


@dataclass(frozen=True)
class FilmFit:
    """A film with all that its random errors come from.

    Parameters
    ----------
    weight : (n_lines, 2)
    unknowns : (2, 4)
    lines : (n_lines,)
        Which bins they are, rising.
    smoothing : (n_lines, n_lines)
        From `core.stiffness.film_fit.smoother`.
    smear_share : (n_lines, 2)
        Share of the bearing's power that integration at the lines leaves over.
    n_segments
        Independent segments.
    floor_std : (2,)
        Relative standard uncertainty of each probe's noise power, as far as it was estimated.
    """

    equations: NormalEquations
    weight: FloatArray
    unknowns: FloatArray
    lines: npt.NDArray[np.int64]
    smoothing: FloatArray
    smear_share: FloatArray
    n_segments: float
    floor_std: FloatArray

    @cached_property
    def film(self) -> ComplexArray:
        """Dynamic stiffness of the film, (n_lines, 2, 2)."""
        return self.equations.film(self.unknowns)

    @cached_property
    def residual(self) -> FloatArray:
        """Power of the force that is left over, (n_lines, 2)."""
        return self.equations.residual(self.unknowns)

    @cached_property
    def _root(self) -> ComplexArray:
        """Hermitian square roots of the shaft's spectra, (n_lines, 2, 2)."""
        shaft = self.equations.shaft
        trace = (shaft[:, 0, 0] + shaft[:, 1, 1]).real
        determinant = (shaft[:, 0, 0] * shaft[:, 1, 1]).real - np.abs(shaft[:, 0, 1]) ** 2
        root = np.sqrt(np.maximum(determinant, 0.0))
        # a matrix solves its own characteristic equation (Cayley and Hamilton)
        whole = shaft + root[:, np.newaxis, np.newaxis] * np.eye(2)
        squared: ComplexArray = whole / np.sqrt(trace + 2.0 * root)[:, np.newaxis, np.newaxis]
        return squared

    @cached_property
    def own_influences(self) -> ComplexArray:
        """Influence of the shaft's motion on the unknowns of each row, (2, n_lines, 4, 2)."""
        inverse = self.equations.inverse(self.weight)
        own: ComplexArray = inverse[:, np.newaxis] @ self.equations.regressors
        return own

    def covariance(self) -> FloatArray:
        """Covariance of the unknowns of each row, (2, 4, 4)."""
        return self._spread(self.own_influences[:, np.newaxis], np.array([[0], [1]]))

    def spread(self, influences: ComplexArray) -> FloatArray:
        """Covariance of groups of n estimates by their influences, (n_groups, n, n).

        Parameters
        ----------
        influences : (n_groups, 2, n_lines, n, 2)
            Of the shaft's motion on the estimates, through the residual of each row.
        """
        return self._spread(influences, np.array([[0, 1]]))

    def _spread(self, influences: ComplexArray, rows: npt.NDArray[np.int64]) -> FloatArray:
        """The same through the residuals of some rows, (n_groups or 1, n_rows)."""
        parts = (influences @ self._parts[rows]).view(np.float64)
        of_rows = correlated_sum(parts, self.lines, PART_PRODUCTS).sum(axis=1)
        weighted = (self.weight[..., np.newaxis] * self.film).transpose(1, 0, 2)[rows]
        # per unit of noise power
        slope = (influences.conj() * weighted[..., np.newaxis, :]).real.sum(axis=(1, 2))
        slope = slope * self.equations.noise_power * self.floor_std
        # real part of conj(x) e with circular e: half of its power (Bendat and Piersol, 9.2)
        covariance: FloatArray = of_rows / (2.0 * self.n_segments)
        covariance += slope @ slope.transpose(0, 2, 1)
        return covariance

    @cached_property
    def _parts(self) -> ComplexArray:
        """Independent parts of the errors per influence, (2, n_lines, 2, 6).

        What integration leaves of neighbouring lines cancels in the part of an influence that is in
        phase with a row's force, whatever chance makes of the size of each: powers are smooth.
        """
        weight, film = self.weight.T[..., None, None], self.film.transpose(1, 0, 2)[..., None, :]
        smear = (self._smoothed(self.equations.force_power) * self.smear_share).T[..., None, None]
        smeared = np.minimum(weight * smear, 1.0)  # of the smooth residual, one over the weight
        rest = weight**2 * self.residual.T[..., None, None] * (1.0 - smeared)
        shaft, across = self.equations.shaft, film.conj().swapaxes(-1, -2)
        force = (film @ shaft @ across).real
        shared = shaft @ across / force
        size = np.sqrt(self._smoothed(force[:, :, 0, 0].T).T)[..., None, None]
        # The residual holds the probes' noise as the shaft's motion does, and so with one phase:
        # E[x*e x*e] is not 0 as for independent signals (Isserlis 1918). What that takes off some
        # coefficients is left in.
        noise = self.equations.noise_power[:, np.newaxis]
        parts = (
            np.sqrt(rest) * self._root,
            np.sqrt(weight * smeared) * size * shared,
            np.sqrt(weight * smeared) * ((np.eye(2) - shared @ film) @ self._smooth_root),
            weight * noise * across,
        )
        return np.concatenate(parts, axis=-1)

    def _smoothed(self, power: FloatArray) -> FloatArray:
        """Straight lines through the logarithm, along the first axis."""
        smooth: FloatArray = np.exp(self.smoothing @ np.log(power))
        return smooth

    @cached_property
    def _smooth_root(self) -> ComplexArray:
        """Square roots of the shaft's spectra with smooth powers, (n_lines, 2, 2)."""
        power = np.diagonal(self.equations.shaft, axis1=1, axis2=2).real
        scale: ComplexArray = np.sqrt(self._smoothed(power) / power)[:, :, np.newaxis] * self._root
        return scale


@dataclass(frozen=True)
class BracketChanges:
    """Changes of the bracket's dynamic stiffness, and how far the residual asks for each.

    One step of Gauss and Newton, with the shaft's motion through the fitted film in the place of
    the bearing's, whose noise would bias the estimates.

    Parameters
    ----------
    stiffnesses : (n, n_lines)
        Change of the dynamic stiffness per unit of each.
    """

    fit: FilmFit
    stiffnesses: ComplexArray

    @cached_property
    def per(self) -> FloatArray:
        """Change of the film's unknowns with each, (n, 2, 4)."""
        equations = self.fit.equations
        moments = np.array([equations.moment(change) for change in self.stiffnesses])
        return equations.solve(self.fit.weight, moments)

    @cached_property
    def _left(self) -> ComplexArray:
        """What each leaves over once the film has followed it, (n_lines, n, 2 rows, 2)."""
        relative = (self.stiffnesses / self.fit.equations.bracket_n_per_m).T
        left: ComplexArray = relative[:, :, np.newaxis, np.newaxis] * self.fit.film[:, np.newaxis]
        left -= np.stack([self.fit.equations.film(unknowns) for unknowns in self.per], axis=1)
        return left

    @cached_property
    def _motion(self) -> ComplexArray:
        """Spectra of the shaft's motion without the probes' noise, (n_lines, 2, 2)."""
        return self.fit.equations.shaft - np.diag(self.fit.equations.noise_power)

    @cached_property
    def _information(self) -> FloatArray:
        moved = self._left @ self._motion[:, np.newaxis]
        information: FloatArray = np.einsum(
            "lr,lprk,lqrk->pq", self.fit.weight, moved, self._left.conj()
        ).real
        return information

    def follow(self, change: int, fitted: Sequence[int]) -> FloatArray:
        """Change of the fitted ones per unit of another, (n_fitted,)."""
        information = self._information
        step = np.linalg.solve(information[np.ix_(fitted, fitted)], information[fitted, change])
        return np.asarray(-step, dtype=np.float64)

    def estimate(self, fitted: Sequence[int]) -> "BracketEstimate | None":
        """Estimate some together, the others as they are; None if they cannot be separated."""
        information = self._information[np.ix_(fitted, fitted)]
        if not np.all(np.linalg.eigvalsh(information) > 0.0):
            return None
        equations = self.fit.equations
        # residual times conjugated shaft motion, without the probes' noise: (n_lines, 2, 2)
        common = equations.bracket_n_per_m[:, np.newaxis, np.newaxis] * equations.cross
        common = common - self.fit.film @ self._motion
        left = self._left[:, fitted]
        score = np.einsum("lr,lprj,lrj->p", self.fit.weight, left.conj(), common).real
        inverse = np.linalg.inv(information)
        influences: ComplexArray = -(inverse @ left.transpose(2, 0, 1, 3))
        [covariance] = self.fit.spread(influences[np.newaxis])
        return BracketEstimate(-inverse @ score, covariance, self.per[fitted], influences)


@dataclass(frozen=True)
class BracketEstimate:
    """Estimates of some changes.

    Parameters
    ----------
    value, covariance : (n,), (n, n)
    per : (n, 2, 4)
        Change of the film's unknowns with each.
    influences : (2, n_lines, n, 2)
        Of the shaft's motion on the values, through the residual of each row.
    """

    value: FloatArray
    covariance: FloatArray
    per: FloatArray
    influences: ComplexArray

    @property
    def std(self) -> FloatArray:
        """Random standard uncertainties, (n,)."""
        std: FloatArray = np.sqrt(np.diagonal(self.covariance))
        return std

    def with_film(self, fit: FilmFit) -> FloatArray:
        """Covariance of the film's unknowns if these are fitted with them, (2, 4, 4)."""
        through = self.per.transpose(1, 2, 0)[:, np.newaxis, np.newaxis] @ self.influences
        for row in (0, 1):
            through[row, row] += fit.own_influences[row]
        return fit.spread(through)
