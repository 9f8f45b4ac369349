"""Random errors of a fitted film, and what its residual says of the bracket and of delays.

Every estimate here is linear in ``Σ_lines w Σ_segments conj(f u) e``: e is the force that the fit
leaves over, f u a linear form of the shaft's motion, its influence on the estimate.
"""

from collections.abc import Iterator, Mapping, Sequence
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
    def own_influences(self) -> Mapping[int, ComplexArray]:
        """Influence of the shaft's motion on the unknowns of each row, (n_lines, 4, 2)."""
        inverse = self.equations.inverse(self.weight)
        return {row: part @ self.equations.regressors for row, part in enumerate(inverse)}

    def covariance(self) -> FloatArray:
        """Covariance of the unknowns of each row, (2, 4, 4)."""
        return np.array([self.spread({row: own}) for row, own in self.own_influences.items()])

    def spread(self, influences: Mapping[int, ComplexArray]) -> FloatArray:
        """Covariance of estimates by their influences, (n, n).

        Parameters
        ----------
        influences
            (n_lines, n, 2) of the shaft's motion on the estimates through a row's residual, by row.
        """
        rows = influences.items()
        slope = np.sum([self._floor_slope(influence, row) for row, influence in rows], axis=0)
        slope = slope * self.equations.noise_power * self.floor_std
        of_rows = np.sum([self._spread_of_row(influence, row) for row, influence in rows], axis=0)
        covariance: FloatArray = of_rows + slope @ slope.T
        return covariance

    def _spread_of_row(self, influence: ComplexArray, row: int) -> FloatArray:
        weight = self.weight[:, row]
        smear = self._smoothed(self.equations.force_power[:, row]) * self.smear_share[:, row]
        smeared = np.minimum(weight * smear, 1.0)  # of the smooth residual, one over the weight
        rest = weight**2 * self.residual[:, row] * (1.0 - smeared)
        motion = influence @ self._root
        spread = correlated_sum(_sized(motion, rest), self.lines, WHITE_PRODUCTS)
        for terms, products in self._smeared_terms(influence, row):
            spread += correlated_sum(_sized(terms, weight * smeared), self.lines, products)
        # The residual holds the probes' noise as the shaft's motion does, and so with one phase:
        # E[x*e x*e] is not 0 as for independent signals (Isserlis 1918). What that takes off some
        # coefficients is left in.
        noise = self.equations.noise_power * self.film[:, row]
        common = weight[:, np.newaxis, np.newaxis] * (influence.conj() @ noise[:, :, np.newaxis])
        spread += correlated_sum(common.real, self.lines, WHITE_PRODUCTS)
        # real part of conj(x) e with circular e: half of its power (Bendat and Piersol, 9.2)
        return spread / (2.0 * self.n_segments)

    def _smoothed(self, power: FloatArray) -> FloatArray:
        """Straight lines through the logarithm, along the first axis."""
        smooth: FloatArray = np.exp(self.smoothing @ np.log(power))
        return smooth

    def _smeared_terms(
        self, influence: ComplexArray, row: int
    ) -> Iterator[tuple[FloatArray | ComplexArray, tuple[float, ...]]]:
        """Parts of an influence in phase, in quadrature and not coherent with a row's force.

        What integration leaves of neighbouring lines cancels in the first, whatever chance makes
        of the size of each: powers are smooth.
        """
        shaft, film = self.equations.shaft, self.film[:, row]
        force = (film[:, np.newaxis] @ shaft @ film.conj()[:, :, np.newaxis])[:, 0, 0].real
        shared = (influence @ shaft @ film.conj()[:, :, np.newaxis]) / force[:, None, None]
        size = np.sqrt(self._smoothed(force))[:, np.newaxis, np.newaxis]
        yield shared.real * size, SMEARED_IN_PHASE
        yield shared.imag * size, SMEARED_IN_QUADRATURE
        apart = influence - shared * film[:, np.newaxis]
        yield apart @ self._smooth_root, SMEARED_APART

    @cached_property
    def _smooth_root(self) -> ComplexArray:
        """Square roots of the shaft's spectra with smooth powers, (n_lines, 2, 2)."""
        power = np.diagonal(self.equations.shaft, axis1=1, axis2=2).real
        scale: ComplexArray = np.sqrt(self._smoothed(power) / power)[:, :, np.newaxis] * self._root
        return scale

    def _floor_slope(self, influence: ComplexArray, row: int) -> FloatArray:
        """Change of the estimates per unit of each probe's noise power, (n, 2)."""
        slope: FloatArray = np.einsum(
            "l,laj,lj->aj", self.weight[:, row], influence.conj(), self.film[:, row]
        ).real
        return slope


def _sized(terms: FloatArray | ComplexArray, power: FloatArray) -> FloatArray | ComplexArray:
    return np.sqrt(power)[:, np.newaxis, np.newaxis] * terms


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
        solve, moment = self.fit.equations.solve, self.fit.equations.moment
        return np.array([solve(self.fit.weight, moment(change)) for change in self.stiffnesses])

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
        """Estimate some of them together, the others as they are; None if they cannot be told."""
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
        through = -np.einsum("pq,lqrj->rlpj", inverse, left)
        influences = dict(enumerate(through))
        return BracketEstimate(
            -inverse @ score, self.fit.spread(influences), self.per[fitted], influences
        )


@dataclass(frozen=True)
class BracketEstimate:
    """Estimates of some changes.

    Parameters
    ----------
    value, covariance : (n,), (n, n)
    per : (n, 2, 4)
        Change of the film's unknowns with each.
    influences
        Of the shaft's motion on the values, by row of the film: (n_lines, n, 2).
    """

    value: FloatArray
    covariance: FloatArray
    per: FloatArray
    influences: Mapping[int, ComplexArray]

    @property
    def std(self) -> FloatArray:
        """Random standard uncertainties, (n,)."""
        std: FloatArray = np.sqrt(np.diagonal(self.covariance))
        return std

    def with_film(self, fit: FilmFit) -> FloatArray:
        """Covariance of the film's unknowns if these are fitted with them, (2, 4, 4)."""
        own = fit.own_influences
        covariances = []
        for row in own:
            through = {
                other: np.einsum("pa,lpj->laj", self.per[:, row], influence)
                for other, influence in self.influences.items()
            }
            through[row] += own[row]
            covariances.append(fit.spread(through))
        return np.array(covariances)
