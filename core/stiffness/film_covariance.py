"""Coherence and random covariance of a fitted film, and bracket changes from the residual force.

Every estimate is a linear function of ``Σ_lines w Σ_segments conj(f u) e``, with the weight w of a
line, the residual force e, and the influence f of the shaft's motion u on the estimate.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from core.arrays import ComplexArray, FloatArray
from core.spectra.cross_spectrum import (
    CORRELATED_LINES,
    SMEARED_APART,
    SMEARED_IN_PHASE,
    SMEARED_IN_QUADRATURE,
    WHITE_PRODUCTS,
    correlated_sum,
)
from core.stiffness.film_fit import N_UNKNOWNS, NormalEquations

PART_PRODUCTS: FloatArray = np.array(
    [
        *[WHITE_PRODUCTS] * 4,  # residual times the shaft's motion
        SMEARED_IN_PHASE,
        SMEARED_IN_QUADRATURE,
        *[SMEARED_APART] * 4,
        WHITE_PRODUCTS,  # probe noise in both
        (0.0, 0.0, 0.0),
    ]
).T
"""Correlation between lines 0, 1 and 2 bins apart, (3, 12), of the real and imaginary parts of
`FilmFit._parts`."""

EACH_ROW = np.array([[0], [1]])
BOTH_ROWS = np.array([[0, 1]])
"""Rows whose residuals enter a group of estimates: each row alone, or both."""


@dataclass(frozen=True)
class FilmFit:
    """Weighted least-squares fit of a film, and the sources of its random errors.

    Parameters
    ----------
    weight : (n_lines, 2)
        Weights from `core.stiffness.film_fit.line_weights`.
    lines : (n_lines,)
        Bin index of each line, ascending.
    smoothing : (n_lines, n_lines)
        Matrix from `core.stiffness.film_fit.smoother`.
    smear_share : (n_lines, 2)
        Power of the integration error as a fraction of the bearing's power.
    n_segments
        Number of independent segments.
    floor_std : (2,)
        Relative standard uncertainty of each probe's noise power; zero if it is known.
    """

    equations: NormalEquations
    weight: FloatArray
    lines: npt.NDArray[np.int64]
    smoothing: FloatArray
    smear_share: FloatArray
    n_segments: float
    floor_std: FloatArray

    @cached_property
    def unknowns(self) -> FloatArray:
        """Coefficients (k_i1, k_i2, c_i1, c_i2) of each row, in N/m, (2, 4)."""
        return self.equations.solve(self.weight, self.equations.force)

    @cached_property
    def film(self) -> ComplexArray:
        """Dynamic stiffness of the film in N/m, (n_lines, 2, 2)."""
        return self.equations.film(self.unknowns)

    @cached_property
    def residual(self) -> FloatArray:
        """Power of the residual force in (N/m)² µm², (n_lines, 2)."""
        return self.equations.residual(self.unknowns)

    @property
    def coherence(self) -> FloatArray:
        """Fraction of each bearing channel's weighted power explained by the film, (2,), 0 to 1."""
        whole = (self.weight * self.equations.force_power).sum(axis=0)
        share: FloatArray = 1.0 - (self.weight * self.residual).sum(axis=0) / whole
        return np.minimum(np.maximum(share, 0.0), 1.0)

    @property
    def coherence_segments(self) -> FloatArray:
        """Number of segments that makes a single line's coherence as certain as `coherence`, (2,).

        The unexplained fraction is residual over total power. Its error comes from each line's
        residual and power, with relative errors of ``1 / √n`` that are correlated by their ratio.
        The residual enters a second time through the weights.
        """
        left, whole = self.weight * self.residual, self.weight * self.equations.force_power
        left, whole = left / left.sum(axis=0), whole / whole.sum(axis=0)
        moves = left + self.smoothing.T @ (whole - left)
        shared = 2.0 * moves * whole * self.residual / self.equations.force_power
        squares = (moves**2 + whole**2 - shared).sum(axis=0)
        variance = CORRELATED_LINES * squares / (self.n_segments - 2.0)  # two fitted inputs
        found: FloatArray = 1.0 + 2.0 * self.coherence / variance
        return found

    @property
    def lack_of_fit(self) -> FloatArray:
        """Ratio of the residual's coherence with the shaft's motion to that by chance, (2,).

        The expected value is 1 if stiffness and damping are constant over the lines: the residual
        is then correlated with the shaft only by chance, according to `n_segments`.
        """
        equations, ratio = self.equations, self.equations.ratio[:, np.newaxis, np.newaxis]
        # moments of the residual with (u_1, u_2, iω u_1, iω u_2): real part, then ratio × imaginary
        left = equations.force - np.einsum("lab,rb->lra", equations.true_gram, self.unknowns)
        common = (left[..., :2] + 1j * left[..., 2:] / ratio).transpose(0, 2, 1)
        shaft = equations.gram[:, :2, :2] + 1j * equations.gram[:, :2, 2:] / ratio
        scaled = np.linalg.solve(shaft.transpose(0, 2, 1), common)
        power = (common.conj() * scaled).sum(axis=1).real
        whole = (self.weight * self.residual).sum(axis=0)
        found: FloatArray = self.n_segments * (self.weight * power).sum(axis=0) / (2.0 * whole)
        return found

    @cached_property
    def own_influences(self) -> ComplexArray:
        """Influence of the shaft's motion on the unknowns of each row, (2, n_lines, 4, 2)."""
        ratio = self.equations.ratio
        regressors = np.zeros((ratio.size, N_UNKNOWNS, 2), dtype=np.complex128)
        regressors[:, (0, 1), (0, 1)] = 1.0
        regressors[:, (2, 3), (0, 1)] = 1j * ratio[:, np.newaxis]
        inverse = np.linalg.inv(self.equations.normal(self.weight))
        own: ComplexArray = inverse[:, np.newaxis] @ regressors
        return own

    def spread(
        self, influences: ComplexArray, rows: npt.NDArray[np.int64] = BOTH_ROWS
    ) -> FloatArray:
        """Return the covariance of groups of n estimates from their influences, (n_groups, n, n).

        Parameters
        ----------
        influences : (n_groups, n_rows, n_lines, n, 2)
            Influence of the shaft's motion on the estimates, through the residual of each row.
        rows : (n_groups or 1, n_rows)
            Force direction of each row of `influences`: 0 for x, 1 for y.
        """
        parts = (influences @ self._parts[rows]).view(np.float64)
        of_rows = correlated_sum(parts, self.lines, PART_PRODUCTS).sum(axis=1)
        weighted = (self.weight[..., np.newaxis] * self.film).transpose(1, 0, 2)[rows]
        # per unit of noise power
        slope = (influences.conj() * weighted[..., np.newaxis, :]).real.sum(axis=(1, 2))
        slope = slope * self.equations.noise_power * self.floor_std
        # the real part of conj(x) e with circular e has half its power (Bendat and Piersol, 9.2)
        covariance: FloatArray = of_rows / (2.0 * self.n_segments)
        covariance += slope @ slope.transpose(0, 2, 1)
        return covariance

    @cached_property
    def _parts(self) -> ComplexArray:
        """Six independent parts of the error per unit of influence, (2, n_lines, 2, 6).

        Integration errors of neighbouring lines cancel in the part of an influence in phase with a
        row's force. Their sizes use smoothed powers, which are free of the scatter of single lines.
        """
        shaft, root = self.equations.shaft, _hermitian_root(self.equations.shaft)
        weight, film = self.weight.T[..., None, None], self.film.transpose(1, 0, 2)[..., None, :]
        smear = (self._smoothed(self.equations.force_power) * self.smear_share).T[..., None, None]
        smeared = np.minimum(weight * smear, 1.0)  # fraction of the smooth residual 1 / weight
        rest = weight**2 * self.residual.T[..., None, None] * (1.0 - smeared)
        across = film.conj().swapaxes(-1, -2)
        force = (film @ shaft @ across).real
        shared = shaft @ across / force
        size = np.sqrt(self._smoothed(force[:, :, 0, 0].T).T)[..., None, None]
        power = np.diagonal(shaft, axis1=1, axis2=2).real
        smooth_root = np.sqrt(self._smoothed(power) / power)[:, :, np.newaxis] * root
        # The probes' noise is in the residual and in the shaft's motion, with a common phase:
        # E[x*e x*e] is not 0 as for independent signals (Isserlis 1918). The resulting reduction of
        # some variances is neglected.
        noise = self.equations.noise_power[:, np.newaxis]
        parts = (
            np.sqrt(rest) * root,
            np.sqrt(weight * smeared) * size * shared,
            np.sqrt(weight * smeared) * ((np.eye(2) - shared @ film) @ smooth_root),
            weight * noise * across,
        )
        return np.concatenate(parts, axis=-1)

    def _smoothed(self, power: FloatArray) -> FloatArray:
        """Return a power spectrum (n_lines, ...), smoothed by local regression of its logarithm."""
        smooth: FloatArray = np.exp(self.smoothing @ np.log(power))
        return smooth


def _hermitian_root(shaft: ComplexArray) -> ComplexArray:
    """Return the Hermitian square roots of cross-spectra, (n_lines, 2, 2)."""
    trace = (shaft[:, 0, 0] + shaft[:, 1, 1]).real
    determinant = (shaft[:, 0, 0] * shaft[:, 1, 1]).real - np.abs(shaft[:, 0, 1]) ** 2
    root = np.sqrt(np.maximum(determinant, 0.0))
    # closed form of the 2 × 2 square root, by the theorem of Cayley and Hamilton
    whole = shaft + root[:, np.newaxis, np.newaxis] * np.eye(2)
    squared: ComplexArray = whole / np.sqrt(trace + 2.0 * root)[:, np.newaxis, np.newaxis]
    return squared


@dataclass(frozen=True)
class BracketEstimate:
    """Estimated changes of properties of the bracket.

    Parameters
    ----------
    value : (n,)
        Estimates.
    std : (n,)
        Random standard uncertainties of the estimates.
    influences : (2, n_lines, n, 2)
        Influence of the shaft's motion on the estimates, through the residual of each row.
    """

    value: FloatArray
    std: FloatArray
    influences: ComplexArray


@dataclass(frozen=True)
class BracketChanges:
    """Changes of the bracket's dynamic stiffness, and their estimation from the residual.

    The estimation is one Gauss-Newton step. It uses the shaft's motion through the fitted film
    instead of the bearing's motion, whose noise would bias the estimates.

    Parameters
    ----------
    stiffnesses : (n, n_lines)
        Derivative of the dynamic stiffness with respect to each change.
    """

    fit: FilmFit
    stiffnesses: ComplexArray

    @cached_property
    def per(self) -> FloatArray:
        """Derivative of the film's unknowns with respect to each change, (n, 2, 4)."""
        equations = self.fit.equations
        return equations.solve(self.fit.weight, equations.moment(self.stiffnesses))

    @cached_property
    def _left(self) -> ComplexArray:
        """Residual per unit of each change after a new fit of the film, (n_lines, n, 2 rows, 2)."""
        relative = (self.stiffnesses / self.fit.equations.bracket_n_per_m).T
        left: ComplexArray = relative[:, :, np.newaxis, np.newaxis] * self.fit.film[:, np.newaxis]
        left -= self.fit.equations.film(self.per)
        return left

    @cached_property
    def _motion(self) -> ComplexArray:
        """Cross-spectra of the shaft's motion without the probes' noise, (n_lines, 2, 2)."""
        return self.fit.equations.shaft - np.diag(self.fit.equations.noise_power)

    @cached_property
    def _information(self) -> FloatArray:
        moved = self._left @ self._motion[:, np.newaxis]
        information: FloatArray = np.einsum(
            "lr,lprk,lqrk->pq", self.fit.weight, moved, self._left.conj()
        ).real
        return information

    def follow(self, change: int, fitted: Sequence[int]) -> FloatArray:
        """Return the shift of fitted changes per unit of another, unfitted change, (n_fitted,)."""
        information = self._information
        step = np.linalg.solve(information[np.ix_(fitted, fitted)], information[fitted, change])
        return np.asarray(-step, dtype=np.float64)

    def estimate(self, fitted: Sequence[int]) -> BracketEstimate | None:
        """Return joint estimates of the fitted changes; None if the data do not separate them."""
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
        return BracketEstimate(-inverse @ score, np.sqrt(np.diagonal(covariance)), influences)

    def film_covariance(self, fitted: Sequence[int], influences: ComplexArray) -> FloatArray:
        """Return the covariance of the film's unknowns fitted together with changes, (2, 4, 4).

        Parameters
        ----------
        fitted
            Indices of the fitted changes.
        influences
            Influences on the estimates of these changes, as in `BracketEstimate`.
        """
        through = self.per[fitted].transpose(1, 2, 0)[:, np.newaxis, np.newaxis] @ influences
        for row in (0, 1):
            through[row, row] += self.fit.own_influences[row]
        return self.fit.spread(through)
