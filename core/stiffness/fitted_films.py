"""Films of several bearings fitted to weighted lines, with parts that lag as pads tilt.

A film is ``K + iωC + R s(ω)``, with the shape s of `tilt_lag` (decision 37). Given R, the
unknowns K and C follow from normal equations; R and its lag are estimated from the residual force.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from core.arrays import ComplexArray, FloatArray
from core.spectra.cross_spectrum import CORRELATED_LINES
from core.stiffness.film_fit import MIN_SHARE, N_UNKNOWNS, ROUNDING, FilmLines

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

LAGS = range(4, 8)
"""Indices of the parts of a film that lag because its pads tilt, after the bracket properties: from
x and y to the force in x, then to that in y; in N/m."""

PARTS = range(4, 10)
"""Indices of `LAGS` and of the deviations of the lags of the forces in x and in y from their prior
mean, in standard deviations of the prior."""


def tilt_lag(
    omega: FloatArray, turn_rad_s: float, deviation: FloatArray
) -> tuple[ComplexArray, ComplexArray]:
    """Return the dynamic stiffness of a unit lagging part, and its derivative, (n, k, n_lines).

    It is ``(iωτ)² / (1 + iωτ)`` less the stiffness and damping at 1×, where it is zero.

    Parameters
    ----------
    omega : (n, 1, n_lines)
        Angular frequencies.
    deviation : (n, k)
        Deviations of the lag τ from its prior mean, in standard deviations of the prior.
    """
    deviation = np.clip(deviation, -MAX_DEVIATION, MAX_DEVIATION)[..., np.newaxis]
    lag_s = TILT_LAG_RAD / turn_rad_s * (1.0 + TILT_LAG_STD * deviation)
    std_s = TILT_LAG_RAD / turn_rad_s * TILT_LAG_STD

    def beside_turn(shape: Callable[[ComplexArray], ComplexArray]) -> ComplexArray:
        turns, at_turn = np.asarray(1j * omega * lag_s), shape(np.asarray(1j * turn_rad_s * lag_s))
        return shape(turns) - at_turn.real - 1j * at_turn.imag * omega / turn_rad_s

    return (
        beside_turn(lambda turn: turn**2 / (1.0 + turn)),
        beside_turn(lambda turn: turn**2 * (2.0 + turn) / (1.0 + turn) ** 2 / lag_s * std_s),
    )


@dataclass(frozen=True)
class FittedFilms:
    """Weighted least-squares fits of the films of n bearings.

    Parameters
    ----------
    weight : (n, 2, n_used)
        Weights from `core.stiffness.film_fit.line_weights`.
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
    parts : (n, 6)
        Estimates of the `PARTS`; zero for a film that is constant over frequency.
    kept : (n, 1)
        Probability that the film has `parts`, by which they are multiplied.
    """

    lines: FilmLines
    weight: FloatArray
    bracket_n_per_m: ComplexArray
    changes: ComplexArray
    smear_share: FloatArray
    n_segments: FloatArray
    floor_std: FloatArray
    turn_rad_s: float
    parts: FloatArray
    kept: FloatArray

    @cached_property
    def _normal(self) -> tuple[FloatArray, FloatArray]:
        normal, share = self.lines.normal(self.weight)
        normal[~(share >= MIN_SHARE)] = np.eye(N_UNKNOWNS)  # may be singular
        return normal, share

    @property
    def signal_share(self) -> FloatArray:
        """Smallest fraction of motion in the weighted shaft spectra of any direction, (n,)."""
        return self._normal[1]

    @cached_property
    def _solved(self) -> FloatArray:
        """Unknowns, and their derivatives with respect to each change, (n, 2, 4, 5)."""
        brackets = np.concatenate([self.bracket_n_per_m[:, np.newaxis], self.changes], axis=1)
        moments = self.lines.moments(self.weight, brackets)
        return np.asarray(np.linalg.solve(self._normal[0], moments), dtype=np.float64)

    @property
    def unknowns(self) -> FloatArray:
        """Coefficients (k_i1, k_i2, c_i1, c_i2) of each row, in N/m, (n, 2, 4)."""
        lagging = self.kept * self.parts[:, : len(LAGS)]
        shift = np.einsum("npru,np->nru", self.per[:, LAGS], lagging)
        return np.asarray(self._solved[..., 0] + shift)

    @cached_property
    def _lag(self) -> tuple[ComplexArray, ComplexArray]:
        """Dynamic stiffness per unit of a row's `LAGS`, and its derivative, (n, 2, n_used)."""
        deviation = self.kept * self.parts[:, len(LAGS) :]
        return tilt_lag(self.lines.omega[:, np.newaxis], self.turn_rad_s, deviation)

    @cached_property
    def _lagging(self) -> FloatArray:
        """Lagging parts of the film in N/m, (n, 2, 2, 1)."""
        return (self.kept * self.parts[:, : len(LAGS)]).reshape(-1, 2, 2, 1)

    @cached_property
    def _part_films(self) -> ComplexArray:
        """Dynamic stiffness of a film per unit of each of the `PARTS`, (n, 6, 2, 2, n_used)."""
        lag, per_deviation = self._lag
        of_parts = np.zeros((len(lag), len(PARTS), 2, 2, lag.shape[-1]), dtype=np.complex128)
        for row, column in np.ndindex(2, 2):
            of_parts[:, 2 * row + column, row, column] = lag[:, row]
            of_parts[:, len(LAGS) + row, row] = self._lagging[:, row] * per_deviation[:, row, None]
        return of_parts

    @cached_property
    def per(self) -> FloatArray:
        """Derivatives of the unknowns with respect to each change, (n, 10, 2, 4).

        The changes are those of the bracket, and the `PARTS`.
        """
        force = times(self._part_films, self._motion[:, np.newaxis])
        ratio = self.lines.ratio[:, np.newaxis, np.newaxis, np.newaxis]
        moments = np.concatenate([force.real, ratio * force.imag], axis=3)
        summed = moments @ self.weight[:, np.newaxis, :, :, np.newaxis]
        of_parts = -np.linalg.solve(self._normal[0][:, np.newaxis], summed)[..., 0]
        return np.concatenate([self._solved[..., 1:].transpose(0, 3, 1, 2), of_parts], axis=1)

    @cached_property
    def film(self) -> ComplexArray:
        """Dynamic stiffness of the films in N/m, (n, 2, 2, n_used)."""
        lagging = self._lagging * self._lag[0][:, :, np.newaxis]
        return self.lines.film(self.unknowns) + lagging

    @cached_property
    def force_power(self) -> FloatArray:
        """Power of the brackets' forces in (N/m)² µm², for each row, (n, 2, n_used)."""
        power = np.abs(self.bracket_n_per_m[:, np.newaxis]) ** 2 * self.lines.bearing_power
        return np.asarray(power)

    @cached_property
    def _force(self) -> ComplexArray:
        """Cross-spectra of the brackets' forces with the shaft's motion, (n, 2, 2, n_used)."""
        force: ComplexArray = self.bracket_n_per_m[:, np.newaxis, np.newaxis] * self.lines.cross
        return force

    @cached_property
    def residual(self) -> FloatArray:
        """Power of the residual force in (N/m)² µm², (n, 2, n_used)."""
        common = (self._force * self.film.conj()).real.sum(axis=2)
        modelled = (times(self.film, self.lines.shaft) * self.film.conj()).real.sum(axis=2)
        left: FloatArray = self.force_power - 2.0 * common + modelled
        return np.maximum(left, 0.0)

    @cached_property
    def _common(self) -> ComplexArray:
        """Residual times the shaft's conjugated motion without noise, (n, 2, 2, n_used)."""
        return self._force - times(self.film, self._motion)

    @cached_property
    def _motion(self) -> ComplexArray:
        """Cross-spectra of the shaft's motion without the probes' noise, (n, 2, 2, n_used)."""
        motion = self.lines.shaft.copy()
        np.einsum("niil->nil", motion)[...] -= self.lines.noise_power[..., np.newaxis]
        return motion

    @cached_property
    def _relative(self) -> ComplexArray:
        """Changes relative to the bracket's dynamic stiffness, (n, 4, n_used)."""
        return self.changes / self.bracket_n_per_m[:, np.newaxis]

    @cached_property
    def _left(self) -> ComplexArray:
        """Residual per unit of each change in `per` after a new fit, (n, ..., 2, 2, n_used)."""
        through = -self.lines.film(self.per)
        through[:, :4] += self._relative[:, :, np.newaxis, np.newaxis] * self.film[:, np.newaxis]
        through[:, PARTS] -= self._part_films
        return through

    @cached_property
    def _information(self) -> FloatArray:
        """Information on the changes in the residual, (n, 10, 10)."""
        moved = times(self._left, self._motion[:, np.newaxis])
        moved *= self.weight[:, np.newaxis, :, np.newaxis]
        return real_product(moved, self._left)

    @cached_property
    def _prior(self) -> FloatArray:
        """Information of the prior on the `PARTS`, which is normal about zero, (n, 6)."""
        direct = np.einsum("nrr->nr", self._solved[:, :, :2, 0])
        direct = np.hypot(direct, np.einsum("nrr->nr", self._solved[:, :, 2:, 0]))
        of_lags = np.repeat(1.0 / (LAG_PRIOR * direct) ** 2, 2, axis=1)
        return np.concatenate([of_lags, np.ones_like(direct)], axis=1)

    @property
    def _size(self) -> FloatArray:
        """Scale of the covariance of estimates, (n, 1, 1)."""
        return CORRELATED_LINES / (2.0 * self.n_segments[..., np.newaxis])

    @cached_property
    def of_parts(self) -> tuple[FloatArray, FloatArray]:
        """Mean, (n, 6), and covariance, (n, 6, 6), of the `PARTS` by spectra and prior."""
        return self.posterior(PARTS)[:2]

    def constant_odds(self) -> FloatArray:
        """Return the ratio of the marginal likelihoods of no `LAGS` and of any, (n,)."""
        _, covariance, significance = self.posterior(LAGS)
        prior = self._prior[:, np.newaxis, : len(LAGS)]
        shrinkage = np.linalg.slogdet(covariance * prior)[1]
        return np.asarray(np.exp(-0.5 * (significance + shrinkage)))

    def posterior(self, fitted: range) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return mean, covariance and significance of `LAGS` or `PARTS` by spectra and prior.

        Returns
        -------
        Mean, (n, p); covariance, (n, p, p); and the squared significance beside none, (n,), if the
        film has none: chi-squared with four degrees of freedom.
        """
        places = range(len(fitted))
        common = self.weight[:, :, np.newaxis] * self._common
        score = -real_product(self._left[:, fitted], common[:, np.newaxis]) / self._size
        information = self._information[:, fitted][..., fitted] / self._size
        prior = self._prior[:, places, np.newaxis] * np.eye(len(fitted))
        covariance = np.asarray(np.linalg.inv(information + prior), dtype=np.float64)
        old = (self.kept * self.parts)[:, places, np.newaxis]
        mean = (covariance @ (score + information @ old))[..., 0]
        significance = (score.swapaxes(1, 2) @ covariance @ score)[:, 0, 0]
        return mean, covariance, significance

    def with_parts(self, kept: FloatArray, fitted: range) -> Self:
        """Return fits with a share (n, 1) of their `LAGS` or `PARTS`, and with their weights."""
        fits = self
        for iteration in range(N_REWEIGHTED + 1 if kept.any() else 0):
            parts = self.parts.copy()
            parts[:, : len(fitted)] = fits.posterior(fitted)[0]
            fits = replace(fits, parts=np.where(kept > 0.0, parts, 0.0), kept=kept)
            if iteration < N_REWEIGHTED:
                least = ROUNDING * fits.force_power
                weight = fits.lines.counted / fits.lines.smoothed(np.maximum(fits.residual, least))
                weight = np.where(kept[..., np.newaxis] > 0.0, weight, self.weight)
                fits = replace(fits, weight=weight)
        return fits


def times(first: ComplexArray, second: ComplexArray) -> ComplexArray:
    """Return the products of (..., n, 2, n_lines) and (..., 2, 2, n_lines) matrices."""
    x, y = first[..., 0, np.newaxis, :], first[..., 1, np.newaxis, :]
    return x * second[..., np.newaxis, 0, :, :] + y * second[..., np.newaxis, 1, :, :]


def real_product(first: ComplexArray, second: ComplexArray) -> FloatArray:
    """Return the real inner products of p and q arrays of each bearing, (n, p, q)."""
    p, q = (np.ascontiguousarray(array) for array in (first, second))
    parts = [array.reshape(*array.shape[:2], -1).view(np.float64) for array in (p, q)]
    product: FloatArray = parts[0] @ parts[1].swapaxes(1, 2)
    return product
