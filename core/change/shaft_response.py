"""Response of 1× shaft motion to film stiffness, learned from a healthy machine.

Film stiffness varies by a factor of four with the operating condition, so healthy readings contain
the shaft motion for a wide range of stiffness. A damaged film has the same effect on the motion as
a healthy film of equal stiffness; a faulty bracket or transducer has a different effect. Unbalance
acts on all bearings alike, so the response is the motion at each film and direction, relative to
the geometric mean over all films and directions.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from core.arrays import BoolArray, FloatArray
from core.baseline.grouping import bisquare, robust_std
from core.baseline.history import DIRECTIONS, StiffnessHistory
from core.change.shaft_line import ShaftLine, learn_lines

FilmDirection: TypeAlias = tuple[str, str]
"""Bearing id and direction of a film."""

MEAN_READINGS = 24
"""Number of readings averaged for a comparison with the response: four hours."""

MIN_MEANS = 50
"""Number of means of `MEAN_READINGS` readings required to learn the response."""

PARTS = 6
"""Number of folds of the cross-validation, each a part of the learning period."""

ROUNDS = 6
RIDGE = 1e-6
MIN_STD = 1e-4


@dataclass(frozen=True)
class ShaftResponse:
    """Relative 1× shaft motion at each film as a quadratic function of ln k of all films.

    Each direction of a bearing counts as a film. Raises `ValueError` if the numbers of values do
    not fit the number of films, or a `std` is not above 0.

    Parameters
    ----------
    places
        Bearing id and direction of each film, in the order of all other arrays.
    centre
        ln of the median stiffness of each film.
    coefficients
        Coefficients of the quadratic function (n_films, n_terms).
    std
        Cross-validated scatter of the means of `MEAN_READINGS` readings of each film, in ln.
    lines
        Lines of the shaft through three bearings, at most one for each direction.
    """

    places: tuple[FilmDirection, ...]
    centre: tuple[float, ...]
    coefficients: tuple[tuple[float, ...], ...]
    std: tuple[float, ...]
    lines: tuple[ShaftLine, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.places)
        shape = [len(row) for row in self.coefficients]
        if len(self.centre) != n or len(self.std) != n or shape != [_n_terms(n)] * n:
            raise ValueError(
                f"{n} films need {n} rows of {_n_terms(n)} coefficients, got rows of lengths"
                f" {shape}; and {n} values of centre and std, got {len(self.centre)} and"
                f" {len(self.std)}"
            )
        if not all(std > 0.0 for std in self.std):
            raise ValueError(f"std must be above 0, got {min(self.std):g}")

    def expected(self, ln_k: FloatArray) -> FloatArray:
        """Return ln of the expected motion over its geometric mean (n_films, n).

        `ln_k` (n_films, n) is ln of the stiffness of the films at n times.
        """
        terms = _terms(ln_k - np.array(self.centre)[:, np.newaxis])
        return np.asarray(np.array(self.coefficients) @ terms)


def learn_response(
    histories: Mapping[str, StiffnessHistory], is_settled: BoolArray
) -> ShaftResponse | None:
    """Learn the shaft response of a unit from stiffness histories by bearing id, at common times.

    Parameters
    ----------
    is_settled : (n,)
        Mask of the times to use, at which the operating condition was settled.

    Returns
    -------
    The response; None if fewer than `MIN_MEANS` times `MEAN_READINGS` settled times have stiffness
    and amplitude of all films.

    Raises
    ------
    ValueError
        If the histories do not have the same times.
    """
    places = tuple((bearing, direction) for bearing in histories for direction in DIRECTIONS)
    ln_k, ln_shaft = film_columns(histories)
    usable = is_settled & np.all(np.isfinite(ln_k) & np.isfinite(ln_shaft), axis=0)
    if np.sum(usable) < MIN_MEANS * MEAN_READINGS:
        return None
    ln_k, ln_shaft = ln_k[:, usable], ln_shaft[:, usable]
    centre = np.median(ln_k, axis=1)
    terms = _terms(ln_k - centre[:, np.newaxis])
    shares = ln_shaft - np.mean(ln_shaft, axis=0)
    return ShaftResponse(
        places,
        tuple(centre.tolist()),
        tuple(tuple(_fit(terms, share).tolist()) for share in shares),
        tuple(max(_mean_std(row), MIN_STD) for row in _held_out(terms, shares)),
        learn_lines(histories, is_settled),
    )


def film_columns(histories: Mapping[str, StiffnessHistory]) -> tuple[FloatArray, FloatArray]:
    """Return ln k and ln of the 1× shaft amplitude of all films, (n_films, n) each; NaN if missing.

    Raises ValueError if the histories do not have the same times.
    """
    first = next(iter(histories.values()))
    for bearing, history in histories.items():
        if not np.array_equal(history.time_ns, first.time_ns):
            raise ValueError(f"readings of {bearing} must be at the times of the other bearings")
    ln_k = np.concatenate([history.ln_k for history in histories.values()])
    shaft = np.concatenate([history.shaft_um_pk for history in histories.values()])
    return ln_k, np.log(np.where(shaft > 0.0, shaft, np.nan))


def _n_terms(n_films: int) -> int:
    return 1 + n_films + n_films * (n_films + 1) // 2


def _terms(x: FloatArray) -> FloatArray:
    """Return the quadratic terms (n_terms, n): 1, each x, and each product of two x."""
    first, second = np.triu_indices(x.shape[0])
    return np.concatenate([np.ones((1, x.shape[1])), x, x[first] * x[second]])


def _fit(terms: FloatArray, share: FloatArray) -> FloatArray:
    weight = np.ones(share.size)
    coefficients = np.zeros(terms.shape[0])
    for _ in range(ROUNDS):
        weighted = terms * weight
        normal = weighted @ terms.T + RIDGE * share.size * np.eye(terms.shape[0])
        coefficients = np.asarray(np.linalg.solve(normal, weighted @ share), np.float64)
        residual = share - coefficients @ terms
        weight = bisquare(residual / max(robust_std(residual), MIN_STD))
    return coefficients


def _held_out(terms: FloatArray, shares: FloatArray) -> FloatArray:
    """Return cross-validated residuals (n_films, n): each fold from a fit to the others."""
    left = np.empty_like(shares)
    for part in np.array_split(np.arange(shares.shape[1]), PARTS):
        others = np.delete(np.arange(shares.shape[1]), part)
        fitted = np.array([_fit(terms[:, others], share[others]) for share in shares])
        left[:, part] = shares[:, part] - fitted @ terms[:, part]
    return left


def _mean_std(residual: FloatArray) -> float:
    n = residual.size // MEAN_READINGS
    means = residual[: n * MEAN_READINGS].reshape(n, MEAN_READINGS).mean(axis=1)
    return float(np.sqrt(np.mean(means**2)))
