"""Coherence and random covariance of fitted films, and bracket changes from the residual force.

Every estimate is a linear function of ``Σ_lines w Σ_segments conj(f u) e``, with the weight w of a
line, the residual force e, and the influence f of the shaft's motion u on the estimate. All
influences are sums of the same nine: the four regressors of a film, the effects of the bracket's
`FITTED` properties through the film, the two lagging motions, and the effect of their lag. Their
covariance is therefore calculated once.
"""

from collections.abc import Sequence
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
from core.stiffness.dynamic_lines import own_power
from core.stiffness.film_fit import N_UNKNOWNS
from core.stiffness.fitted_films import (
    DAMPING,
    DELAY,
    LAGS,
    MASS,
    PARTS,
    FittedFilms,
    real_product,
    times,
)

PART_PRODUCTS: FloatArray = np.array(
    [
        *[WHITE_PRODUCTS] * 2,  # residual times the shaft's motion
        SMEARED_IN_PHASE,
        *[SMEARED_APART] * 2,
        WHITE_PRODUCTS,  # probe noise in both
        *[WHITE_PRODUCTS] * 2,
        SMEARED_IN_QUADRATURE,
        *[SMEARED_APART] * 2,
    ]
).T
"""Correlation between lines 0, 1 and 2 bins apart, (3, 11), of the parts of the error: real parts
of the six of `FilmFits._parts`, then imaginary parts of the first five."""

N_PARTS = 6

FITTED = (DELAY, MASS)
"""Bracket properties that can be fitted together with the film."""

N_INFLUENCES = N_UNKNOWNS + len(FITTED) + 3
LAGGING, TILTING = slice(N_INFLUENCES - 3, N_INFLUENCES - 1), N_INFLUENCES - 1
"""Influences of the lagging motions, and of their lag."""


class FilmFits(FittedFilms):
    """Fitted films with their coherence, bracket changes and sources of random errors."""

    def delay_significance(self) -> FloatArray:
        """Return the squared significance of a delay of the bearing channels, (n,)."""
        value, information = self.estimate([DELAY])[0], self._information[:, DELAY, DELAY]
        return value[:, 0] ** 2 * information / self._size[:, 0, 0]

    @cached_property
    def coherence(self) -> FloatArray:
        """Share of each bearing channel's weighted power explained by the film, (n, 2), 0 to 1."""
        whole = _summed(self.weight, self.force_power)
        share: FloatArray = 1.0 - _summed(self.weight, self.residual) / whole
        return np.minimum(np.maximum(share, 0.0), 1.0)

    @property
    def coherence_segments(self) -> FloatArray:
        """Number of segments that makes a line's coherence as certain as `coherence`, (n, 2).

        The unexplained fraction is residual over total power. Its error comes from each line's
        residual and power, with relative errors of ``1 / √n`` that are correlated by their ratio.
        The residual enters a second time through the weights.
        """
        left, whole = self.weight * self.residual, self.weight * self.force_power
        left /= left.sum(axis=-1, keepdims=True)
        whole /= whole.sum(axis=-1, keepdims=True)
        moves = left + (whole - left) @ self.lines.smoothing.swapaxes(1, 2)
        shared = 2.0 * moves * whole * self.residual / self.force_power
        squares = (moves**2 + whole**2 - shared).sum(axis=-1)
        variance = CORRELATED_LINES * squares / (self.n_segments - 2.0)  # two fitted inputs
        found: FloatArray = 1.0 + 2.0 * self.coherence / variance
        return found

    @property
    def lack_of_fit(self) -> FloatArray:
        """Ratio of the residual's coherence with the shaft's motion to that by chance, (n, 2).

        The expected value is 1 if stiffness and damping are constant over the lines: the residual
        is then correlated with the shaft only by chance, according to `n_segments`.
        """
        shaft, (x, y) = self.lines.shaft, self._common.swapaxes(0, 2).swapaxes(1, 2)
        xx, yy = shaft[:, 0, 0, np.newaxis].real, shaft[:, 1, 1, np.newaxis].real
        yx = shaft[:, 1, 0, np.newaxis]
        own = np.abs(x) ** 2 * yy + np.abs(y) ** 2 * xx - 2.0 * (x.conj() * yx * y).real
        power = own / (xx * yy - np.abs(yx) ** 2)
        whole = _summed(self.weight, self.residual)
        found: FloatArray = self.n_segments * _summed(self.weight, power) / (2.0 * whole)
        return found

    def follow(self, change: int, fitted: Sequence[int]) -> FloatArray:
        """Return how a wrong bracket property shifts those that are fitted, (n, n_fitted).

        The properties are numbered as in `changes`: `change` is the wrong one, `fitted` are one or
        two others. Shifts are per unit of the wrong property, and invalid where `estimate` is NaN.
        """
        inverse, _ = _inverse(self._information[:, fitted][..., fitted])
        return -(inverse @ self._information[:, fitted, change, np.newaxis])[..., 0]

    def estimate(self, fitted: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        """Return joint estimates of some of the `FITTED` changes and `PARTS`, and their influences.

        The estimation is one Gauss-Newton step. It uses the shaft's motion through the fitted film
        instead of the bearing's motion, whose noise would bias the estimates.

        Returns
        -------
        Estimates, (n, n_fitted), NaN where the data do not separate the changes; and the weights of
        the influences in them as a single group of `covariance`.
        """
        inverse, separate = _inverse(self._information[:, fitted][..., fitted])
        weighted = (self.weight[:, :, np.newaxis] * self._common)[:, np.newaxis]
        score = real_product(self._left[:, fitted], weighted)
        value = np.where(separate[:, np.newaxis], -(inverse @ score)[..., 0], np.nan)
        return value, self._influences(inverse, fitted)

    def _influences(self, inverse: FloatArray, fitted: Sequence[int]) -> FloatArray:
        """Return weights of the influences in estimates with an inverse information matrix."""
        own = np.zeros((len(inverse), 2, len(fitted), N_INFLUENCES))
        own[..., :N_UNKNOWNS] = self.per[:, fitted].swapaxes(1, 2)
        for n, change in enumerate(fitted):
            if change in FITTED:
                own[..., n, N_UNKNOWNS + FITTED.index(change)] = -1.0
            elif change in LAGS:
                row, column = divmod(change - LAGS.start, 2)
                own[:, row, n, LAGGING.start + column] = 1.0
            else:
                own[:, change - LAGS.stop, n, TILTING] = 1.0
        return (inverse[:, np.newaxis] @ own)[:, np.newaxis]

    def delay(self, fitted: Sequence[int]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return `DELAY`, first of joint estimates, its uncertainty and per `DAMPING`, (n,)."""
        value, influences = self.estimate(fitted)
        std = np.sqrt(self.covariance(influences)[:, 0, 0, 0])
        return value[:, 0], std, self.follow(DAMPING, fitted)[:, 0]

    def parts_left(self, dropped: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return covariances of the unknowns from what of `PARTS` is left, (n, 2, 4, 4) by row.

        The first is from the doubt whether there are any, which differs between averages; the
        second from the error of the prior, and from a share `dropped` (n, 1) that is not estimated.
        """
        mean, covariance = self.of_parts
        of_prior = covariance @ (self._prior[..., np.newaxis] * covariance)
        whole = covariance + mean[..., np.newaxis] * mean[:, np.newaxis]
        kept, per = self.kept[..., np.newaxis], self.per[:, PARTS].transpose(0, 2, 3, 1)
        doubt = kept * (1.0 - kept) * whole
        left = kept * of_prior + dropped[..., np.newaxis] * whole
        of_doubt, of_rest = (
            np.asarray(per @ each[:, np.newaxis] @ per.swapaxes(2, 3)) for each in (doubt, left)
        )
        return of_doubt, of_rest

    def through_parts(self) -> FloatArray:
        """Return weights of the influences in the unknowns through the kept `PARTS`, by row."""
        inverse = self.kept[..., np.newaxis] * self.of_parts[1] / self._size
        return self.through(PARTS, self._influences(inverse, PARTS))

    def parts_follow(self) -> FloatArray:
        """Return the change of the kept `PARTS` per wrong bracket property, (n, 6, 4)."""
        information = self._information[:, PARTS, :4] / self._size
        return -self.kept[..., np.newaxis] * (self.of_parts[1] @ information)

    def through(self, fitted: Sequence[int], influences: FloatArray) -> FloatArray:
        """Return weights of the influences in the unknowns through fitted changes, by row."""
        of_each = np.moveaxis(influences, 3, 1)[:, :, :, :, np.newaxis]
        return np.asarray((self.per[:, fitted][..., np.newaxis, :, np.newaxis] * of_each).sum(1))

    def film_covariance(self, through: FloatArray | float = 0.0) -> FloatArray:
        """Return the covariance of the films' unknowns, (n, 2, 4, 4).

        `through` holds the weights through changes that were fitted with the film.
        """
        through = np.zeros((len(self.weight), 2, 2, N_UNKNOWNS, N_INFLUENCES)) + through
        inverse = np.linalg.inv(self._normal[0])
        for row in (0, 1):
            through[:, row, row, :, :N_UNKNOWNS] += inverse[:, row]
        return self.covariance(through)

    def covariance(self, weights: FloatArray) -> FloatArray:
        """Return the covariance of groups of estimates, (n, n_groups, n_estimates, n_estimates).

        Parameters
        ----------
        weights : (n, n_groups, 2, n_estimates, 9)
            Weights of the influences in the estimates, through the residual of each row.
        """
        covariance, slope = self._spread
        own = (weights @ covariance[:, np.newaxis] @ weights.swapaxes(-1, -2)).sum(axis=2)
        through = (weights @ slope[:, np.newaxis]).sum(axis=2)
        own += through @ through.swapaxes(-1, -2)
        return np.asarray(own)

    @cached_property
    def _spread(self) -> tuple[FloatArray, FloatArray]:
        """Covariance of the influences' sums, (n, 2, 9, 9), and its part from the noise floor.

        The second array, (n, 2, 9, 2), holds the change of the sums per standard uncertainty of
        each probe's noise power.
        """
        lines, parts = self.lines, self._parts
        ratio = lines.ratio[:, np.newaxis, np.newaxis, np.newaxis]
        relative = self._relative[:, np.newaxis, FITTED]
        moved = (self.film[:, :, :, np.newaxis] * parts).sum(axis=2)
        moved = relative[:, :, :, np.newaxis] * moved[:, :, np.newaxis]
        terms = np.empty((*parts.shape[:2], N_INFLUENCES, 2 * N_PARTS - 1, parts.shape[-1]))
        terms[:, :, :2, :N_PARTS] = parts.real
        terms[:, :, :2, N_PARTS:] = parts.imag[..., : N_PARTS - 1, :]
        np.multiply(-ratio, parts.imag, out=terms[:, :, 2:4, :N_PARTS])
        np.multiply(ratio, terms[:, :, :2, : N_PARTS - 1], out=terms[:, :, 2:4, N_PARTS:])
        lag, per_deviation = (each[:, :, np.newaxis, np.newaxis] for each in self._lag)
        tilting = per_deviation * (self._lagging[..., np.newaxis] * parts).sum(2, keepdims=True)
        moved = np.concatenate([moved, lag * parts, tilting], axis=2)
        terms[:, :, 4:, :N_PARTS] = moved.real
        terms[:, :, 4:, N_PARTS:] = moved.imag[..., : N_PARTS - 1, :]
        # the real part of conj(x) e with circular e has half its power (Bendat and Piersol, 9.2)
        covariance = correlated_sum(terms, lines.lines, PART_PRODUCTS)
        covariance /= 2.0 * self.n_segments[..., np.newaxis, np.newaxis]
        # per unit of noise power
        weight = self.weight[:, :, np.newaxis]
        weighted = weight * self.film
        slope = np.empty((*parts.shape[:2], N_INFLUENCES, 2))
        slope[:] = 0.0
        np.einsum("...ii->...i", slope[:, :, :2])[...] = weighted.real.sum(axis=-1)
        np.einsum("...ii->...i", slope[:, :, 2:4])[...] = (ratio[:, 0] * weighted.imag).sum(axis=-1)
        power = weight * (self.film.real**2 + self.film.imag**2)
        slope[:, :, 4:6] = relative.real @ power.swapaxes(-1, -2)
        turned = [
            (each.conj() * weighted).real.sum(axis=-1)
            for each in (lag[..., 0, :], per_deviation[..., 0, :])
        ]
        np.einsum("...ii->...i", slope[:, :, LAGGING])[...] = turned[0]
        slope[:, :, TILTING] = self._lagging[..., 0] * turned[1]
        slope *= (lines.noise_power * self.floor_std)[:, np.newaxis, np.newaxis]
        return covariance, slope

    @cached_property
    def _parts(self) -> ComplexArray:
        """Six independent parts of the error per unit of motion, (n, 2 rows, 2, 6, n_used).

        Integration errors of neighbouring lines cancel in the part of an influence in phase with a
        row's force. Their sizes use smoothed powers, which are free of the scatter of single lines.
        """
        lines, shaft = self.lines, self.lines.shaft
        root, across = _hermitian_root(shaft), self.film.conj()
        moved = times(self.film, shaft)
        force = (moved * across).real.sum(axis=2)
        shared = moved.conj() / force[:, :, np.newaxis]
        smear = lines.smoothed(self.force_power) * self.smear_share
        smeared = np.minimum(self.weight * smear, 1.0)  # fraction of the residual, 1 / weight
        rest = np.sqrt(self.weight**2 * self.residual * (1.0 - smeared))
        smeared_root = np.sqrt(self.weight * smeared)
        power = own_power(shaft)
        smooth_root = np.sqrt(lines.smoothed(power) / power)[:, :, np.newaxis] * root
        apart = (
            smooth_root[:, np.newaxis]
            - shared[:, :, :, np.newaxis] * times(self.film, smooth_root)[:, :, np.newaxis]
        )
        parts = np.empty((*self.weight.shape[:2], 2, N_PARTS, shaft.shape[-1]), dtype=np.complex128)
        parts[:, :, :, :2] = rest[:, :, np.newaxis, np.newaxis] * root[:, np.newaxis]
        size = smeared_root * np.sqrt(lines.smoothed(force))
        parts[:, :, :, 2] = size[:, :, np.newaxis] * shared
        parts[:, :, :, 3:5] = smeared_root[:, :, np.newaxis, np.newaxis] * apart
        # The probes' noise is in the residual and in the shaft's motion, with a common phase:
        # E[x*e x*e] is not 0 as for independent signals (Isserlis 1918). The resulting reduction of
        # some variances is neglected.
        noise = lines.noise_power[:, np.newaxis, :, np.newaxis]
        parts[:, :, :, 5] = self.weight[:, :, np.newaxis] * noise * across
        return parts


def _summed(weight: FloatArray, values: FloatArray) -> FloatArray:
    """Return the sum over the lines of weighted values, (n, 2)."""
    total: FloatArray = np.einsum("nrl,nrl->nr", weight, values)
    return total


def _inverse(information: FloatArray) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Return inverses of (n, p, p) matrices, and where they are positive definite.

    Elsewhere the inverse is the identity.
    """
    separate = (information[:, 0, 0] > 0.0) & (np.linalg.det(information) > 0.0)
    safe = np.where(separate[:, np.newaxis, np.newaxis], information, np.eye(len(information[0])))
    return np.linalg.inv(safe), separate


def _hermitian_root(shaft: ComplexArray) -> ComplexArray:
    """Return the Hermitian square roots of cross-spectra, (n, 2, 2, n_lines)."""
    own = own_power(shaft)
    determinant = own[:, 0] * own[:, 1] - np.abs(shaft[:, 0, 1]) ** 2
    root = np.sqrt(np.maximum(determinant, 0.0))
    # closed form of the 2 × 2 square root, by the theorem of Cayley and Hamilton
    whole = shaft.copy()
    np.einsum("niil->nil", whole)[...] += root[:, np.newaxis]
    whole /= np.sqrt(own.sum(axis=1) + 2.0 * root)[:, np.newaxis, np.newaxis]
    return whole
