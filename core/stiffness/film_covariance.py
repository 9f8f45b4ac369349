"""Coherence and random covariance of fitted films, and bracket changes from the residual force.

Every estimate is a linear function of ``Σ_lines w Σ_segments conj(f u) e``, with the weight w of a
line, the residual force e, and the influence f of the shaft's motion u on the estimate. All
influences of a row are sums of its terms (`core.stiffness.fitted_films`) with the effects of the
bracket's properties through the film.
"""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from core.arrays import BoolArray, ComplexArray, FloatArray
from core.spectra.cross_spectrum import (
    CORRELATED_LINES,
    SMEARED_APART,
    SMEARED_IN_PHASE,
    SMEARED_IN_QUADRATURE,
    WHITE_PRODUCTS,
    correlated_sum,
)
from core.stiffness.film_fit import N_UNKNOWNS
from core.stiffness.fitted_films import (
    DAMPING,
    DELAY,
    N_LAGS,
    N_PARTS,
    N_TERMS,
    FittedFilms,
    times,
)

ERROR_PRODUCTS: FloatArray = np.array(
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
of the six of `FilmFits._errors`, then imaginary parts of the first five."""

N_ERRORS = 6

N_CHANGES = 4

CHANGES = slice(N_TERMS, N_TERMS + N_CHANGES)
"""Effects of the bracket properties through the film, after the terms of a row."""

LAGS = range(4, 8)
"""Indices of the lagging parts of both rows, after the bracket properties."""

OF_ROW = [[*range(N_CHANGES), *LAGS[:2], 8], [*range(N_CHANGES), *LAGS[2:], 9]]
"""Indices of the bracket properties and of the parts that a row depends on."""


class FilmFits(FittedFilms):
    """Fitted films with their coherence, bracket changes and sources of random errors."""

    def delay_significance(self) -> FloatArray:
        """Return the squared significance of a delay of the bearing channels, (n,)."""
        value, information = self.estimate([DELAY])[0], self._information[:, DELAY, DELAY]
        return value[:, 0] ** 2 * information / self.inputs.size[:, 0]

    @cached_property
    def coherence(self) -> FloatArray:
        """Share of each bearing channel's weighted power explained by the film, (n, 2), 0 to 1."""
        whole = _summed(self.weight, self.inputs.force_power)
        share: FloatArray = 1.0 - _summed(self.weight, self.residual) / whole
        return np.minimum(np.maximum(share, 0.0), 1.0)

    @property
    def coherence_segments(self) -> FloatArray:
        """Number of segments that would make the coherence at one line equally certain, (n, 2).

        The unexplained fraction is residual over total power. Its error comes from each line's
        residual and power, with relative errors of ``1 / √n`` that are correlated by their ratio.
        The residual enters a second time through the weights.
        """
        left, whole = self.weight * self.residual, self.weight * self.inputs.force_power
        left /= left.sum(axis=-1, keepdims=True)
        whole /= whole.sum(axis=-1, keepdims=True)
        moves = left + (whole - left) @ self.inputs.lines.smoothing.swapaxes(1, 2)
        shared = 2.0 * moves * whole * self.residual / self.inputs.force_power
        squares = (moves**2 + whole**2 - shared).sum(axis=-1)
        variance = CORRELATED_LINES * squares / (self.inputs.n_segments - 2.0)  # two fitted inputs
        return np.asarray(1.0 + 2.0 * self.coherence / variance)

    @property
    def lack_of_fit(self) -> FloatArray:
        """Coherence of residual and shaft motion divided by its expected chance value, (n, 2).

        The expected value is 1 if stiffness and damping are constant over the lines: the residual
        is then correlated with the shaft only by chance, according to `n_segments`.
        """
        shaft, (x, y) = self.inputs.lines.shaft, self.common.swapaxes(0, 2).swapaxes(1, 2)
        xx, yy = shaft[:, 0, 0, np.newaxis].real, shaft[:, 1, 1, np.newaxis].real
        yx = shaft[:, 1, 0, np.newaxis]
        own = np.abs(x) ** 2 * yy + np.abs(y) ** 2 * xx - 2.0 * (x.conj() * yx * y).real
        power = own / (xx * yy - np.abs(yx) ** 2)
        whole = _summed(self.weight, self.residual)
        return np.asarray(self.inputs.n_segments * _summed(self.weight, power) / (2.0 * whole))

    @cached_property
    def per_change(self) -> FloatArray:
        """Derivatives of the unknowns with respect to each bracket property, (n, 2, 4, 4)."""
        normal, of_force = self.weighted.normal[..., :N_UNKNOWNS, :N_UNKNOWNS], self._changed[0]
        return np.asarray(np.linalg.solve(normal, of_force), dtype=np.float64)

    @cached_property
    def _changed(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Weighted products of changed forces: all for each row and change.

        Returns
        -------
        Products of the changed brackets' forces with the first functions, (n, 2, 4, 4), and of the
        films' forces, changed in the same proportion, with all functions, (n, 2, 8, 4), with each
        other, (n, 2, 4, 4), and with the residual, (n, 2, 4).
        """
        weight, functions = self.weight[:, :, np.newaxis], self.weighted.terms.functions
        relative = self.inputs.relative[:, np.newaxis]
        changes = relative.view(np.float64).swapaxes(2, 3)

        def products(force: ComplexArray, n_functions: int) -> FloatArray:
            weighted = (weight * force.conj())[:, :, np.newaxis]
            moments = functions[:, :, :n_functions, np.newaxis] * weighted
            flat = moments.view(np.float64).reshape(*moments.shape[:2], 2 * n_functions, -1)
            return np.asarray(flat @ changes)

        power = (self.moved * self.film.conj()).real.sum(axis=2, keepdims=True) * weight
        squared = (relative * power).view(np.float64) @ changes
        rest = (self.film.conj() * self.common).sum(axis=2, keepdims=True) * weight
        left = (rest.view(np.float64) @ changes)[:, :, 0]
        return products(self.inputs.force, 2), products(self.moved, 4), squared, left

    @cached_property
    def _sensitivity(self) -> FloatArray:
        """Residual per unit of each change and part after a new fit, (n, 2, 10, 11).

        The changes of both rows are expressed by the terms of each row and by its `CHANGES`.
        """
        through = np.zeros((len(self.parts), 2, 10, N_TERMS + N_CHANGES))
        through[:, :, :N_CHANGES, :N_UNKNOWNS] = -self.per_change.swapaxes(2, 3)
        through[:, :, :N_CHANGES, CHANGES] = np.eye(N_CHANGES)
        for row, of_row in enumerate(OF_ROW):
            through[:, row, of_row[N_CHANGES:], :N_TERMS] = self._part_sensitivity[:, row]
        return through

    @cached_property
    def _part_sensitivity(self) -> FloatArray:
        """Residual per unit of each part of a row after a new fit, by its terms, (n, 2, 3, 7)."""
        through = np.empty((len(self.parts), 2, N_PARTS, N_TERMS))
        through[..., :N_UNKNOWNS] = -self.per_part.swapaxes(2, 3)
        through[..., N_UNKNOWNS:] = -np.eye(N_PARTS)
        return through

    @cached_property
    def _information(self) -> FloatArray:
        """Information on the changes and parts in the residual, (n, 10, 10)."""
        _, to_functions, squared, _ = self._changed
        gram = np.empty((*squared.shape[:2], N_TERMS + N_CHANGES, N_TERMS + N_CHANGES))
        of_terms = self.of_terms.swapaxes(2, 3)
        gram[..., :N_TERMS, :N_TERMS] = of_terms @ self.weighted.normal @ self.of_terms
        gram[..., CHANGES, CHANGES] = squared
        to_terms = of_terms @ to_functions
        gram[..., :N_TERMS, CHANGES] = to_terms
        gram[..., CHANGES, :N_TERMS] = to_terms.swapaxes(2, 3)
        through = self._sensitivity
        return np.asarray((through @ gram @ through.swapaxes(2, 3)).sum(axis=1))

    @cached_property
    def _score(self) -> FloatArray:
        """Products of the residual with its changes, (n, 10, 1)."""
        modelled = self.weighted.normal[..., :6] @ self.coefficients[..., np.newaxis]
        rest = self.weighted.moments[..., np.newaxis] - modelled
        of_terms = self.of_terms.swapaxes(2, 3) @ rest
        left = np.concatenate([of_terms, self._changed[3][..., np.newaxis]], axis=2)
        return np.asarray((self._sensitivity @ left).sum(axis=1))

    def follow(self, change: int, fitted: Sequence[int]) -> FloatArray:
        """Return the errors of fitted bracket properties per unit error of another, (n, n_fitted).

        `change` is the index of the wrong property in axis 1 of `FilmInputs.changes`, `fitted` are
        the indices of the fitted properties. Errors are invalid where `estimate` is NaN.
        """
        inverse, _ = _inverse(self._information[:, fitted][..., fitted])
        return -(inverse @ self._information[:, fitted, change, np.newaxis])[..., 0]

    def estimate(self, fitted: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        """Return joint estimates of some bracket properties and `LAGS`, with weights.

        The estimation is one Gauss-Newton step. It uses the shaft's motion through the fitted film
        instead of the bearing's motion, whose noise would bias the estimates.

        Returns
        -------
        Estimates, (n, n_fitted), NaN where the data do not separate the changes; and the weights
        (n, 2, n_fitted, 11) of the terms and bracket properties of each row in them, for
        `covariance`.
        """
        inverse, separate = _inverse(self._information[:, fitted][..., fitted])
        steps = -inverse
        value = (steps @ self._score[:, fitted])[..., 0]
        influences = steps[:, np.newaxis] @ self._sensitivity[:, :, fitted]
        return np.where(separate[:, np.newaxis], value, np.nan), influences

    def delays(self, fits: Sequence[Sequence[int]]) -> FloatArray:
        """Return the delay of the bearing channels by several joint fits, (n_fits, 3, n).

        Axis 1: delay in s, its standard uncertainty, and its change per N·s/m of bracket damping.
        Each of `fits` lists the indices of the properties that are fitted together, `DELAY` first.
        """
        found = [self.estimate(fitted) for fitted in fits]
        weights = np.concatenate([influences[:, :, :1] for _, influences in found], axis=2)
        std = np.sqrt(np.einsum("nee->en", self.covariance(weights)))
        follows = [self.follow(DAMPING, fitted)[:, 0] for fitted in fits]
        return np.stack([np.array([value[:, 0] for value, _ in found]), std, follows], axis=1)

    def parts_left(self, dropped: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return two covariances of the unknowns due to lagging parts of the film, (n, 2, 4, 4).

        The first is due to the doubt whether the film has lagging parts, which differs between
        averages; the second to the error of their prior, and to the fraction `dropped` (n, 1) of
        them that is left out.
        """
        mean, covariance, _ = self.of_parts
        of_prior = covariance @ (self.prior[..., np.newaxis] * covariance)
        whole = covariance + mean[..., np.newaxis] * mean[..., np.newaxis, :]
        kept, per = self.kept[..., np.newaxis, np.newaxis], self.per_part
        doubt = kept * (1.0 - kept) * whole
        left = kept * of_prior + dropped[..., np.newaxis, np.newaxis] * whole
        return per @ doubt @ per.swapaxes(2, 3), per @ left @ per.swapaxes(2, 3)

    def per_change_with_parts(self) -> FloatArray:
        """Return derivatives of the unknowns by bracket property, parts refitted, (n, 2, 4, 4)."""
        follow = np.empty((len(self.parts), 2, N_PARTS, N_CHANGES))
        for row, of_row in enumerate(OF_ROW):
            follow[:, row] = self._information[:, of_row[N_CHANGES:], :N_CHANGES]
        follow /= -self.inputs.size[..., np.newaxis, np.newaxis]
        kept = self.kept[..., np.newaxis, np.newaxis]
        return self.per_change + self.per_part @ (kept * self.of_parts[1] @ follow)

    def film_covariance(self) -> FloatArray:
        """Return the random covariance of the unknowns fitted with the parts, (n, 2, 4, 4)."""
        kept = (self.kept / self.inputs.size)[..., np.newaxis, np.newaxis]
        steps = kept * self.per_part @ self.of_parts[1]
        weights = self._inverse_normal - steps @ self._part_sensitivity
        covariance, slope = self._spread(weights)
        return covariance + slope @ slope.swapaxes(2, 3)

    def film_covariance_with(self, fitted: Sequence[int]) -> FloatArray:
        """Return the random covariance of the unknowns if the properties `fitted` are fitted too.

        The result is (n, 2, 4, 4); `fitted` are the indices of the bracket properties.
        """
        influences, own = self.estimate(fitted)[1], self._inverse_normal
        found = []
        for row in (0, 1):
            weights = self.per_change[:, np.newaxis, row][..., fitted] @ influences
            weights[:, row, :, :N_TERMS] += own[:, row]
            found.append(self.covariance(weights))
        return np.stack(found, axis=1)

    @cached_property
    def _inverse_normal(self) -> FloatArray:
        """Weights of the influences in the unknowns, if nothing else is fitted, (n, 2, 4, 7)."""
        weights = np.zeros((len(self.parts), 2, N_UNKNOWNS, N_TERMS))
        normal = self.weighted.normal[..., :N_UNKNOWNS, :N_UNKNOWNS]
        weights[..., :N_UNKNOWNS] = np.linalg.inv(normal)
        return weights

    def covariance(self, weights: FloatArray) -> FloatArray:
        """Return the covariance of estimates, (n, n_estimates, n_estimates).

        `weights` (n, 2, n_estimates, 7 or 11) are the weights in the estimates of the 7 terms of
        each row and, if included, of the 4 bracket properties.
        """
        own, slope = self._spread(weights)
        through = slope.sum(axis=1)
        return np.asarray(own.sum(axis=1) + through @ through.swapaxes(1, 2))

    def _spread(self, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the covariance from the residual of each row, and the part of the noise floor.

        The first, (n, 2, n_estimates, n_estimates), is without the second, (n, 2, n_estimates, 2):
        the change of the estimates per standard uncertainty of each probe's noise power.
        """
        lines, n_estimates = self.inputs.lines, weights.shape[2]
        # influence of motion in x and in y on each estimate
        tilt = weights[..., N_TERMS - 1 : N_TERMS] * self.kept_parts[:, :, np.newaxis, :N_LAGS]
        of_functions = np.concatenate([weights[..., : N_TERMS - 1], tilt], axis=3)
        by_motion = of_functions.reshape(*weights.shape[:3], 4, 2).swapaxes(3, 4)
        functions = self.weighted.terms.functions.view(np.float64)
        flat = by_motion.reshape(*weights.shape[:2], 2 * n_estimates, 4) @ functions
        influence = flat.reshape(*weights.shape[:3], 2, -1).view(np.complex128)
        if weights.shape[3] > N_TERMS:
            relative = self.inputs.relative.view(np.float64)[:, np.newaxis]
            changed = (weights[..., CHANGES] @ relative).view(np.complex128)
            influence += changed[:, :, :, np.newaxis] * self.film[:, :, np.newaxis]
        errors = self._errors[:, :, np.newaxis]
        moved = influence[..., 0, np.newaxis, :] * errors[:, :, :, 0]
        moved += influence[..., 1, np.newaxis, :] * errors[:, :, :, 1]
        terms = np.concatenate([moved.real, moved.imag[..., : N_ERRORS - 1, :]], axis=3)
        # the real part of conj(x) e with circular e has half its power (Bendat and Piersol, 9.2)
        covariance = correlated_sum(terms, lines.lines, ERROR_PRODUCTS)
        covariance /= 2.0 * self.inputs.n_segments[..., np.newaxis, np.newaxis]
        # per unit of noise power
        weighted = (self.weight[:, :, np.newaxis] * self.film)[:, :, np.newaxis]
        products = influence.view(np.float64) * weighted.view(np.float64)
        floor = lines.noise_power * self.inputs.floor_std
        slope = products.sum(axis=-1) * floor[:, np.newaxis, np.newaxis]
        return covariance, slope

    @cached_property
    def _errors(self) -> ComplexArray:
        """Six independent parts of the error per unit of motion, (n, 2 rows, 2, 6, n_used).

        Integration errors of neighbouring lines cancel in the part of an influence in phase with a
        row's force. Their sizes use smoothed powers, which are free of the scatter of single lines.
        """
        lines, weight = self.inputs.lines, self.weight
        root, across = lines.shaft_root, self.film.conj()
        moved = times(self.film, lines.shaft)
        force = (moved * across).real.sum(axis=2)
        shared = moved.conj() / force[:, :, np.newaxis]
        smear = self.inputs.smooth_force_power * self.inputs.smear_share
        smeared = np.minimum(weight * smear, 1.0)  # fraction of the residual, 1 / weight
        rest = weight * np.sqrt(self.residual * (1.0 - smeared))
        smeared_root = np.sqrt(weight * smeared)
        smooth_root = lines.smooth_shaft_root
        apart = (
            smooth_root[:, np.newaxis]
            - shared[:, :, :, np.newaxis] * times(self.film, smooth_root)[:, :, np.newaxis]
        )
        errors = np.empty((*weight.shape[:2], 2, N_ERRORS, weight.shape[-1]), dtype=np.complex128)
        errors[:, :, :, :2] = rest[:, :, np.newaxis, np.newaxis] * root[:, np.newaxis]
        size = smeared_root * np.sqrt(lines.smoothed(force))
        errors[:, :, :, 2] = size[:, :, np.newaxis] * shared
        errors[:, :, :, 3:5] = smeared_root[:, :, np.newaxis, np.newaxis] * apart
        # The probes' noise is in the residual and in the shaft's motion, with a common phase:
        # E[x*e x*e] is not 0 as for independent signals (Isserlis 1918). The resulting reduction of
        # some variances is neglected.
        noise = lines.noise_power[:, np.newaxis, :, np.newaxis]
        errors[:, :, :, 5] = weight[:, :, np.newaxis] * noise * across
        return errors


def _summed(weight: FloatArray, values: FloatArray) -> FloatArray:
    """Return the sum over the lines of weighted values, (n, 2)."""
    return np.asarray(np.einsum("nrl,nrl->nr", weight, values))


def _inverse(information: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return inverses of (n, p, p) matrices, and where they are positive definite.

    Elsewhere the inverse is the identity.
    """
    separate = (information[:, 0, 0] > 0.0) & (np.linalg.det(information) > 0.0)
    safe = np.where(separate[:, np.newaxis, np.newaxis], information, np.eye(len(information[0])))
    return np.linalg.inv(safe), separate
