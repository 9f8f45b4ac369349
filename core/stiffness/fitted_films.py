"""Films of several bearings fitted to weighted lines, with parts that lag as pads tilt.

A film is ``K + iωC + R s(ω)``, with the shape s of `tilt_lag` (decision 37). Given R, the
unknowns K and C follow from normal equations; R and its lag are estimated from the residual force.

The force of a row depends on the coefficients of this row alone. Whatever is summed over lines is
therefore a small matrix for each row over its terms: four of K and C, the two lagging parts, the
lag, and the bracket properties that can change.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from core.arrays import ComplexArray, FloatArray
from core.spectra.cross_spectrum import CORRELATED_LINES
from core.stiffness.film_fit import N_UNKNOWNS, ROUNDING, FilmLines, FilmTerms, WeightedTerms

TILT_LAG_RAD, TILT_LAG_STD = 0.135, 0.2
"""Prior mean and relative standard deviation of the angle by which the shaft turns during the lag.
It is about half the time that oil takes along a pad: 0.10 to 0.17 rad for the 12 and 16 pads of
Brito et al."""

LAG_PRIOR = 0.3
"""Prior standard deviation of a lagging part as a fraction of the row's direct dynamic stiffness.
Pads of Brito et al. have -0.19 to 0.46 of their stiffness, up to eccentricity ratios of 0.6."""

MAX_DEVIATION = 2.5
"""Largest deviation of the lag from its prior mean, in standard deviations of the prior."""

N_REWEIGHTED = 2
"""Number of new fits of lagging parts with the weights of their own residual."""

STIFFNESS, MASS, DAMPING, DELAY = range(4)
"""Indices of the bracket properties that can change: relative stiffness, mass in kg, damping in
N·s/m, and delay of the bearing channels in s."""

N_LAGS, N_PARTS = 2, 3
"""Number of lagging parts of a row, from motion in x and in y, in N/m; and with the deviation of
the lag from its prior mean, in standard deviations of the prior."""

N_TERMS = N_UNKNOWNS + N_PARTS


def tilt_lag(
    omega: FloatArray, turn_rad_s: float, deviation: FloatArray
) -> tuple[ComplexArray, ComplexArray]:
    """Return the dynamic stiffness of a unit lagging part, and its derivative, (n, k, n_lines).

    It is ``(iωτ)² / (1 + iωτ)`` less the stiffness and damping at 1×, where it is zero.

    Parameters
    ----------
    omega : (n, n_lines)
        Angular frequencies.
    turn_rad_s
        Angular velocity of the shaft.
    deviation : (n, k)
        Deviations of the lag τ from its prior mean, in standard deviations of the prior.
    """
    deviation = np.clip(deviation, -MAX_DEVIATION, MAX_DEVIATION)[..., np.newaxis]
    relative = 1.0 + TILT_LAG_STD * deviation
    orders = np.empty((len(omega), 1, omega.shape[1] + 1))
    orders[:, 0, :-1], orders[..., -1] = omega / turn_rad_s, 1.0  # the last is 1×
    turned = 1j * (TILT_LAG_RAD * relative * orders)
    share = 1.0 / (1.0 + turned)
    shape = turned * turned * share
    slope = shape * (1.0 + share) * (TILT_LAG_STD / relative)
    return _beside_turn(shape, orders), _beside_turn(slope, orders)


def _beside_turn(shape: ComplexArray, orders: FloatArray) -> ComplexArray:
    """Return a dynamic stiffness less the stiffness and damping of its last value, at 1×."""
    at_turn = shape[..., -1:]
    return shape[..., :-1] - at_turn.real - 1j * (at_turn.imag * orders[..., :-1])


@dataclass(frozen=True)
class FilmInputs:
    """Measured lines of n bearings with their brackets, to which films are fitted.

    Parameters
    ----------
    bracket_n_per_m : (n, n_used)
        Dynamic stiffness of the brackets.
    changes : (n, 4, n_used)
        Derivatives of the dynamic stiffness with respect to `STIFFNESS`, `MASS`, `DAMPING` and
        `DELAY`.
    smear_share : (n, 2, n_used)
        Power of the integration error as a fraction of the bearing's power.
    n_segments : (n, 1)
        Number of independent segments.
    floor_std : (n, 2)
        Relative standard uncertainty of each probe's noise power; zero if it is known.
    turn_rad_s
        Angular velocity of the shaft.
    """

    lines: FilmLines
    bracket_n_per_m: ComplexArray
    changes: ComplexArray
    smear_share: FloatArray
    n_segments: FloatArray
    floor_std: FloatArray
    turn_rad_s: float

    @cached_property
    def force(self) -> ComplexArray:
        """Cross-spectra of the brackets' forces with the shaft's motion, (n, 2, 2, n_used)."""
        return np.asarray(self.bracket_n_per_m[:, np.newaxis, np.newaxis] * self.lines.cross)

    @cached_property
    def force_power(self) -> FloatArray:
        """Power of the brackets' forces in (N/m)² µm², for each row, (n, 2, n_used)."""
        squared = self.bracket_n_per_m.real**2 + self.bracket_n_per_m.imag**2
        return np.asarray(squared[:, np.newaxis] * self.lines.bearing_power)

    @cached_property
    def smooth_force_power(self) -> FloatArray:
        """Smoothed `force_power`, (n, 2, n_used)."""
        return self.lines.smoothed(self.force_power)

    @cached_property
    def relative(self) -> ComplexArray:
        """The `changes` divided by the bracket's dynamic stiffness, (n, 4, n_used)."""
        return self.changes / self.bracket_n_per_m[:, np.newaxis]

    @cached_property
    def size(self) -> FloatArray:
        """Factors (n, 1) that convert inverse normal matrices to covariances of estimates."""
        return CORRELATED_LINES / (2.0 * self.n_segments)

    def terms(self, deviation: FloatArray) -> FilmTerms:
        """Return the terms of films whose lag deviates from the mean of its prior.

        `deviation` is in standard deviations of the prior, (n, 1) for both rows of a film, or
        (n, 2) for each row.
        """
        lines = self.lines
        shape, slope = tilt_lag(lines.omega, self.turn_rad_s, deviation)
        functions = np.empty((*shape.shape[:2], 4, shape.shape[2]), dtype=np.complex128)
        functions[:, :, 0], functions[:, :, 1] = 1.0, 1j * lines.ratio[:, np.newaxis]
        functions[:, :, 2], functions[:, :, 3] = shape, slope
        return FilmTerms(lines, functions, self.force)


@dataclass(frozen=True)
class FittedFilms:
    """Weighted least-squares fits of the films of n bearings.

    Parameters
    ----------
    weighted
        Terms with the lags of `parts`, and weights of the lines.
    parts : (n, 2, 3)
        Estimates of the lagging parts of each row, in N/m, and of the deviation of their lag; zero
        for a film that is constant over frequency.
    kept : (n, 1)
        Probability that the film has `parts`, by which they are multiplied.
    """

    inputs: FilmInputs
    weighted: WeightedTerms
    parts: FloatArray
    kept: FloatArray

    @cached_property
    def kept_parts(self) -> FloatArray:
        """Parts times the probability that the film has them, (n, 2, 3)."""
        return self.kept[..., np.newaxis] * self.parts

    @property
    def weight(self) -> FloatArray:
        """Weights of the lines, (n, 2, n_used)."""
        return self.weighted.weight

    @cached_property
    def _of_parts(self) -> FloatArray:
        """Lagging terms with which each part begins, (n, 2, 4, 3)."""
        of_parts = np.zeros((len(self.parts), 2, 4, N_PARTS))
        of_parts[..., :N_LAGS, :N_LAGS] = np.eye(N_LAGS)
        of_parts[..., N_LAGS:, N_LAGS] = self.kept_parts[..., :N_LAGS]
        return of_parts

    @cached_property
    def of_terms(self) -> FloatArray:
        """Functions with which each term begins, (n, 2, 8, 7)."""
        of_terms = np.zeros((len(self.parts), 2, 8, N_TERMS))
        of_terms[..., :N_UNKNOWNS, :N_UNKNOWNS] = np.eye(N_UNKNOWNS)
        of_terms[..., N_UNKNOWNS:, N_UNKNOWNS:] = self._of_parts
        return of_terms

    @cached_property
    def per_part(self) -> FloatArray:
        """Derivatives of the unknowns of a row with respect to its parts, (n, 2, 4, 3)."""
        return -self.weighted.solved[..., 1:] @ self._of_parts

    @property
    def unknowns(self) -> FloatArray:
        """Coefficients (k_i1, k_i2, c_i1, c_i2) of each row, c × `omega_unit`, N/m, (n, 2, 4)."""
        return self.coefficients[..., :N_UNKNOWNS]

    @cached_property
    def coefficients(self) -> FloatArray:
        """Coefficients of the film's six terms: unknowns and lagging parts, (n, 2, 6)."""
        lags, solved = self.kept_parts[..., :N_LAGS], self.weighted.solved
        shift = (solved[..., 1 : 1 + N_LAGS] @ lags[..., np.newaxis])[..., 0]
        return np.concatenate([solved[..., 0] - shift, lags], axis=2)

    @cached_property
    def film(self) -> ComplexArray:
        """Dynamic stiffness of the films in N/m, (n, 2, 2, n_used)."""
        functions = self.weighted.terms.functions.view(np.float64)[:, :, :3]
        by_motion = self.coefficients.reshape(-1, 2, 3, 2).swapaxes(2, 3)
        return np.asarray(by_motion @ functions).view(np.complex128)

    @cached_property
    def residual(self) -> FloatArray:
        """Power of the residual force in (N/m)² µm², (n, 2, n_used)."""
        return self.weighted.terms.residual(self.inputs.force_power, self.coefficients)

    @cached_property
    def moved(self) -> ComplexArray:
        """Cross-spectra of the films' forces with the shaft's motion, (n, 2, 2, n_used)."""
        return times(self.film, self.inputs.lines.motion)

    @cached_property
    def common(self) -> ComplexArray:
        """Cross-spectra of residual force and shaft motion without noise, (n, 2, 2, n_used)."""
        return self.inputs.force - self.moved

    @cached_property
    def prior(self) -> FloatArray:
        """Reciprocal prior variance of each part, normal with zero mean, (n, 2, 3)."""
        direct = np.hypot(
            np.einsum("nrr->nr", self.weighted.solved[:, :, :2, 0]),
            np.einsum("nrr->nr", self.weighted.solved[:, :, 2:, 0]),
        )
        prior = np.ones((*direct.shape, N_PARTS))
        prior[..., :N_LAGS] = 1.0 / (LAG_PRIOR * direct[..., np.newaxis]) ** 2
        return prior

    @cached_property
    def of_lags(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Posterior mean (n, 2, 2), covariance and score of the lagging parts."""
        return self._posterior(N_LAGS)

    @cached_property
    def of_parts(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Posterior mean (n, 2, 3), covariance and score of the lagging parts and their lag."""
        return self._posterior(N_PARTS)

    @cached_property
    def lag_significance(self) -> FloatArray:
        """Squared significance of lagging parts beside none, (n,), if the film has none.

        It is chi-squared with four degrees of freedom.
        """
        _, covariance, score = self.of_lags
        return np.asarray((score * (covariance @ score)).sum(axis=(1, 2, 3)))

    def constant_odds(self) -> FloatArray:
        """Return the likelihood ratio of films without and with lagging parts, (n,)."""
        covariance = self.of_lags[1]
        shrinkage = np.linalg.slogdet(covariance * self.prior[..., np.newaxis, :N_LAGS])[1]
        return np.asarray(np.exp(-0.5 * (self.lag_significance + shrinkage.sum(axis=1))))

    def _posterior(self, n_parts: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return mean (n, 2, p), covariance (n, 2, p, p) and score of the first parts of each row.

        The score, (n, 2, p, 1), is the derivative of the logarithm of the likelihood.
        """
        of_parts = self._of_parts[..., :n_parts]
        reduced = of_parts.swapaxes(2, 3) @ self.weighted.reduced
        reduced /= self.inputs.size[..., np.newaxis, np.newaxis]
        information, kept = reduced[..., 1:] @ of_parts, self.kept_parts[..., :n_parts, np.newaxis]
        score = reduced[..., :1] - information[..., :N_LAGS] @ kept[..., :N_LAGS, :]
        precision = information.copy()
        np.einsum("...ii->...i", precision)[...] += self.prior[..., :n_parts]
        covariance = np.asarray(np.linalg.inv(precision), dtype=np.float64)
        mean = covariance @ (score + information @ kept)
        return mean[..., 0], covariance, score

    def with_parts(self, kept: FloatArray, n_parts: int) -> Self:
        """Return fits that have the first `n_parts` parts with the probability `kept` (n, 1).

        Their lines are weighted by their own residuals.
        """
        fits, inputs = self, self.inputs
        any_kept = kept[..., np.newaxis] > 0.0
        for iteration in range(N_REWEIGHTED + 1 if kept.any() else 0):
            parts = self.parts.copy()
            found = fits.of_lags if n_parts == N_LAGS else fits.of_parts
            parts[..., :n_parts] = found[0]
            parts = np.where(any_kept, parts, 0.0)
            weighted = fits.weighted
            if n_parts == N_PARTS:
                terms = inputs.terms(kept * parts[..., N_LAGS])
                weighted = WeightedTerms(terms, weighted.weight)
            fits = type(self)(inputs, weighted, parts, kept)
            if iteration < N_REWEIGHTED:
                least = ROUNDING * inputs.force_power
                smooth = inputs.lines.smoothed(np.maximum(fits.residual, least))
                weight = np.where(any_kept, inputs.lines.counted / smooth, self.weight)
                fits = type(self)(inputs, WeightedTerms(weighted.terms, weight), parts, kept)
        return fits


def times(first: ComplexArray, second: ComplexArray) -> ComplexArray:
    """Return the products of (..., n, 2, n_lines) and (..., 2, 2, n_lines) matrices."""
    x, y = first[..., 0, np.newaxis, :], first[..., 1, np.newaxis, :]
    return x * second[..., np.newaxis, 0, :, :] + y * second[..., np.newaxis, 1, :, :]
