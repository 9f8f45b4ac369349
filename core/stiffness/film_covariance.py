"""Coherence and random covariance of fitted films, and bracket changes from the residual force.

Every estimate is a linear function of ``Σ_lines w Σ_segments conj(f u) e``, with the weight w of a
line, the residual force e, and the influence f of the shaft's motion u on the estimate. All
influences are sums of the same eight: the four regressors of a film, the effects of the bracket's
`FITTED` properties through the film, and the two lagging motions. Their covariance is therefore
calculated once.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
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
from core.stiffness.film_fit import MIN_SHARE, N_UNKNOWNS, ROUNDING, FilmLines

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

N_REWEIGHTED = 2
"""Number of new fits of lagging parts with the weights of their own residual."""

STIFFNESS, MASS, DAMPING, DELAY = range(4)
"""Indices of the bracket properties that can change: relative stiffness, mass in kg, damping in
N·s/m, and delay of the bearing channels in s."""

FITTED = (DELAY, MASS)
"""Bracket properties that can be fitted together with the film."""

LAGS = range(4, 8)
"""Indices of the parts of a film that lag because its pads tilt, after the bracket properties: from
x and y to the force in x, then to that in y; in N/m."""

N_INFLUENCES = N_UNKNOWNS + len(FITTED)


@dataclass(frozen=True)
class FilmFits:
    """Weighted least-squares fits of the films of n bearings, and sources of their random errors.

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
    lag : (n, n_used)
        Dynamic stiffness per unit of a part in `LAGS`.
    lagging : (n, 4)
        Parts of the film that lag, in N/m; zero for a film that is constant over frequency.
    """

    lines: FilmLines
    weight: FloatArray
    bracket_n_per_m: ComplexArray
    changes: ComplexArray
    smear_share: FloatArray
    n_segments: FloatArray
    floor_std: FloatArray
    lag: ComplexArray
    lagging: FloatArray

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
        return self._solved[..., 0] + self._shift(self.lagging)

    @cached_property
    def _lag_moments(self) -> FloatArray:
        """Moments of the lagging motions with the regressors of each row, (n, 2, 4, 2)."""
        moved = self._motion * self.lag[:, np.newaxis, np.newaxis]
        scaled = self.lines.ratio[:, np.newaxis, np.newaxis] * moved.imag
        moments = np.concatenate([moved.real, scaled], axis=2).reshape(len(moved), 8, -1)
        weighted = (moments @ self.weight.swapaxes(1, 2)).reshape(-1, 2, N_UNKNOWNS, 2)
        return weighted.transpose(0, 3, 2, 1)

    @cached_property
    def lag_per(self) -> FloatArray:
        """Derivatives of a row's unknowns with respect to its two parts in `LAGS`, (n, 2, 4, 2)."""
        return -np.asarray(np.linalg.solve(self._normal[0], self._lag_moments), dtype=np.float64)

    @cached_property
    def per(self) -> FloatArray:
        """Derivatives of the unknowns with respect to each change, (n, 4 or 8, 2, 4).

        The changes are those of the bracket, and `LAGS` if the film has lagging parts.
        """
        of_bracket = self._solved[..., 1:].transpose(0, 3, 1, 2)
        if not self.has_lags:
            return of_bracket
        of_lags = np.einsum("nruj,rs->nrjsu", self.lag_per, np.eye(2))  # each acts on one row
        return np.concatenate([of_bracket, of_lags.reshape(-1, 4, 2, N_UNKNOWNS)], axis=1)

    @property
    def has_lags(self) -> bool:
        """Whether one of the films has lagging parts."""
        return bool(self.lagging.any())

    @cached_property
    def lag_fit(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Estimated parts in `LAGS`, (n, 4), covariance of each row's, (n, 2, 2, 2), significance.

        The significance, (n,), is chi-squared of four if the film has no other lagging parts.
        """
        shape = np.abs(self.lag[:, np.newaxis]) ** 2 * self.weight
        own = np.einsum("nrl,njkl->nrjk", shape, self._motion.real)
        information = own + self._lag_moments.swapaxes(2, 3) @ self.lag_per
        turned = (self.lag.conj()[:, np.newaxis, np.newaxis] * self._common).real
        score = np.einsum("nrl,nrcl->nrc", self.weight, turned)
        inverse = _inverse(information.reshape(-1, 2, 2))[0].reshape(information.shape)
        found = np.einsum("nrjk,nrk->nrj", inverse, score)
        size = CORRELATED_LINES / (2.0 * self.n_segments[:, 0])
        covariance = size[:, np.newaxis, np.newaxis, np.newaxis] * inverse
        significance = (found * score).sum(axis=(1, 2)) / size
        return self.lagging + found.reshape(-1, 4), covariance, significance

    def delay_significance(self) -> FloatArray:
        """Return the squared significance of a delay of the bearing channels, (n,)."""
        value, information = self.estimate([DELAY])[0][:, 0], self._information[:, DELAY, DELAY]
        return np.asarray(2.0 * self.n_segments[:, 0] / CORRELATED_LINES * value**2 * information)

    @cached_property
    def film(self) -> ComplexArray:
        """Dynamic stiffness of the films in N/m, (n, 2, 2, n_used)."""
        lagging = self.lagging.reshape(-1, 2, 2, 1) * self.lag[:, np.newaxis, np.newaxis]
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
        modelled = (_times(self.film, self.lines.shaft) * self.film.conj()).real.sum(axis=2)
        left: FloatArray = self.force_power - 2.0 * common + modelled
        return np.maximum(left, 0.0)

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

    @cached_property
    def _common(self) -> ComplexArray:
        """Residual times the shaft's conjugated motion without noise, (n, 2, 2, n_used)."""
        return self._force - _times(self.film, self._motion)

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
        for part in LAGS if self.has_lags else ():
            through[:, part, *divmod(part - LAGS[0], 2)] -= self.lag
        return through

    @cached_property
    def _information(self) -> FloatArray:
        """Information on the changes in the residual, (n, 4, 4) or (n, 8, 8)."""
        moved = _times(self._left, self._motion[:, np.newaxis])
        moved *= self.weight[:, np.newaxis, :, np.newaxis]
        return _real_product(moved, self._left)

    def follow(self, change: int, fitted: Sequence[int]) -> FloatArray:
        """Return how a wrong bracket property shifts those that are fitted, (n, n_fitted).

        The properties are numbered as in `changes`: `change` is the wrong one, `fitted` are one or
        two others. Shifts are per unit of the wrong property, and invalid where `estimate` is NaN.
        """
        inverse, _ = _inverse(self._information[:, fitted][..., fitted])
        return -(inverse @ self._information[:, fitted, change, np.newaxis])[..., 0]

    def estimate(self, fitted: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        """Return joint estimates of some of the `FITTED` changes and `LAGS`, and their influences.

        The estimation is one Gauss-Newton step. It uses the shaft's motion through the fitted film
        instead of the bearing's motion, whose noise would bias the estimates.

        Returns
        -------
        Estimates, (n, n_fitted), NaN where the data do not separate the changes; and the weights of
        the influences in them as a single group of `covariance`.
        """
        inverse, separate = _inverse(self._information[:, fitted][..., fitted])
        weighted = (self.weight[:, :, np.newaxis] * self._common)[:, np.newaxis]
        score = _real_product(self._left[:, fitted], weighted)
        value = np.where(separate[:, np.newaxis], -(inverse @ score)[..., 0], np.nan)
        own = np.zeros((len(value), 2, len(fitted), self._n_influences))
        own[..., :N_UNKNOWNS] = self.per[:, fitted].swapaxes(1, 2)
        for n, change in enumerate(fitted):
            if change in FITTED:
                own[..., n, N_UNKNOWNS + FITTED.index(change)] = -1.0
            else:
                row, column = divmod(change - LAGS[0], 2)
                own[:, row, n, N_UNKNOWNS + len(FITTED) + column] = 1.0
        return value, (inverse[:, np.newaxis] @ own)[:, np.newaxis]

    def delay(self, fitted: Sequence[int]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return `DELAY`, first of joint estimates, its uncertainty and per `DAMPING`, (n,)."""
        value, influences = self.estimate(fitted)
        std = np.sqrt(self.covariance(influences)[:, 0, 0, 0])
        return value[:, 0], std, self.follow(DAMPING, fitted)[:, 0]

    def with_lags(self, share: FloatArray) -> "FilmFits":
        """Return fits with a share (n, 1) of their estimated lagging parts, and their weights."""
        if not share.any():
            return self
        fits = replace(self, lagging=share * self.lag_fit[0])
        for _ in range(N_REWEIGHTED):
            least = ROUNDING * fits.force_power
            weight = fits.lines.counted / fits.lines.smoothed(np.maximum(fits.residual, least))
            weight = np.where(share[..., np.newaxis] > 0.0, weight, self.weight)
            fits = replace(fits, weight=weight)
            fits = replace(fits, lagging=share * fits.lag_fit[0])
        return fits

    def _shift(self, lagging: FloatArray) -> FloatArray:
        """Return the change of the unknowns by lagging parts (n, 4), (n, 2, 4)."""
        shift: FloatArray = np.einsum("nrup,nrp->nru", self.lag_per, lagging.reshape(-1, 2, 2))
        return shift

    def lags_shift(self) -> tuple[FloatArray, FloatArray]:
        """Return the change of unknowns by all lagging parts, and its uncertainty, (n, 2, 4)."""
        lagging, covariance, _ = self.lag_fit
        variance = np.einsum("nrup,nrpq,nruq->nru", self.lag_per, covariance, self.lag_per)
        return self._shift(lagging), np.sqrt(np.maximum(variance, 0.0))

    def through(self, fitted: Sequence[int], influences: FloatArray) -> FloatArray:
        """Return weights of the influences in the unknowns through fitted changes, by row."""
        of_each = np.moveaxis(influences, 3, 1)[:, :, :, :, np.newaxis]
        return np.asarray((self.per[:, fitted][..., np.newaxis, :, np.newaxis] * of_each).sum(1))

    def film_covariance(self, through: FloatArray | float = 0.0) -> FloatArray:
        """Return the covariance of the films' unknowns, (n, 2, 4, 4).

        `through` holds the weights through changes that were fitted with the film.
        """
        through = np.zeros((len(self.weight), 2, 2, N_UNKNOWNS, self._n_influences)) + through
        inverse = np.linalg.inv(self._normal[0])
        for row in (0, 1):
            through[:, row, row, :, :N_UNKNOWNS] += inverse[:, row]
        return self.covariance(through)

    def covariance(self, weights: FloatArray) -> FloatArray:
        """Return the covariance of groups of estimates, (n, n_groups, n_estimates, n_estimates).

        Parameters
        ----------
        weights : (n, n_groups, 2, n_estimates, 6 or 8)
            Weights of the influences in the estimates, through the residual of each row.
        """
        covariance, slope = self._spread
        own = (weights @ covariance[:, np.newaxis] @ weights.swapaxes(-1, -2)).sum(axis=2)
        through = (weights @ slope[:, np.newaxis]).sum(axis=2)
        own += through @ through.swapaxes(-1, -2)
        return np.asarray(own)

    @property
    def _n_influences(self) -> int:
        return N_INFLUENCES + 2 * self.has_lags

    @cached_property
    def _spread(self) -> tuple[FloatArray, FloatArray]:
        """Covariance of the influences' sums, (n, 2, 6, 6), and its part from the noise floor.

        The second array, (n, 2, 6, 2), holds the change of the sums per standard uncertainty of
        each probe's noise power.
        """
        lines, parts = self.lines, self._parts
        ratio = lines.ratio[:, np.newaxis, np.newaxis, np.newaxis]
        relative = self._relative[:, np.newaxis, FITTED]
        moved = (self.film[:, :, :, np.newaxis] * parts).sum(axis=2)
        moved = relative[:, :, :, np.newaxis] * moved[:, :, np.newaxis]
        n_influences = self._n_influences
        terms = np.empty((*parts.shape[:2], n_influences, 2 * N_PARTS - 1, parts.shape[-1]))
        terms[:, :, :2, :N_PARTS] = parts.real
        terms[:, :, :2, N_PARTS:] = parts.imag[..., : N_PARTS - 1, :]
        np.multiply(-ratio, parts.imag, out=terms[:, :, 2:4, :N_PARTS])
        np.multiply(ratio, terms[:, :, :2, : N_PARTS - 1], out=terms[:, :, 2:4, N_PARTS:])
        if self.has_lags:
            lagging = self.lag[:, np.newaxis, np.newaxis, np.newaxis] * parts
            moved = np.concatenate([moved, lagging], axis=2)
        terms[:, :, 4:, :N_PARTS] = moved.real
        terms[:, :, 4:, N_PARTS:] = moved.imag[..., : N_PARTS - 1, :]
        # the real part of conj(x) e with circular e has half its power (Bendat and Piersol, 9.2)
        covariance = correlated_sum(terms, lines.lines, PART_PRODUCTS)
        covariance /= 2.0 * self.n_segments[..., np.newaxis, np.newaxis]
        # per unit of noise power
        weight = self.weight[:, :, np.newaxis]
        weighted = weight * self.film
        slope = np.empty((*parts.shape[:2], n_influences, 2))
        slope[:] = 0.0
        np.einsum("...ii->...i", slope[:, :, :2])[...] = weighted.real.sum(axis=-1)
        np.einsum("...ii->...i", slope[:, :, 2:4])[...] = (ratio[:, 0] * weighted.imag).sum(axis=-1)
        power = weight * (self.film.real**2 + self.film.imag**2)
        slope[:, :, 4:6] = relative.real @ power.swapaxes(-1, -2)
        if self.has_lags:
            turned = (self.lag.conj()[:, np.newaxis, np.newaxis] * weighted).real.sum(axis=-1)
            np.einsum("...ii->...i", slope[:, :, 6:])[...] = turned
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
        moved = _times(self.film, shaft)
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
            - shared[:, :, :, np.newaxis] * _times(self.film, smooth_root)[:, :, np.newaxis]
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


def _times(first: ComplexArray, second: ComplexArray) -> ComplexArray:
    """Return the products of (..., n, 2, n_lines) and (..., 2, 2, n_lines) matrices."""
    x, y = first[..., 0, np.newaxis, :], first[..., 1, np.newaxis, :]
    return x * second[..., np.newaxis, 0, :, :] + y * second[..., np.newaxis, 1, :, :]


def _summed(weight: FloatArray, values: FloatArray) -> FloatArray:
    """Return the sum over the lines of weighted values, (n, 2)."""
    total: FloatArray = np.einsum("nrl,nrl->nr", weight, values)
    return total


def _real_product(first: ComplexArray, second: ComplexArray) -> FloatArray:
    """Return the real inner products of p and q arrays of each bearing, (n, p, q)."""
    p, q = (np.ascontiguousarray(array) for array in (first, second))
    parts = [array.reshape(*array.shape[:2], -1).view(np.float64) for array in (p, q)]
    product: FloatArray = parts[0] @ parts[1].swapaxes(1, 2)
    return product


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
