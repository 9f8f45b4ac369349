"""Cause of a change of stiffness: the film, the oil of all films, or bracket and transducers.

Stiffness is measured as bracket motion over shaft motion times the bracket's stiffness. Each fault
that can change it moves the shaft at 1× in its own way, and the healthy machine has shown how the
shaft moves for any stiffness of its films (`core.change.shaft_response`):

- a film: as with films of the measured stiffness;
- an accelerometer: not at all;
- shaft probes: each reads more by what its stiffness reads less, less the distance that the shaft
  seems to run further out, and the shaft moves as before;
- a loose bracket: as with films in series with a softer bracket.

A cause is named only if the motion agrees with it and with no other.
"""

from dataclasses import dataclass, fields
from enum import StrEnum
from functools import cached_property

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.change.shaft_response import MEAN_READINGS, FilmDirection, ShaftResponse


class Cause(StrEnum):
    """Cause of a change of stiffness."""

    FILM = "film"
    OIL = "oil"
    BRACKET_OR_TRANSDUCER = "bracket_or_transducer"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Attribution:
    """Cause of a change, with its evidence.

    Parameters
    ----------
    film_share
        Fraction of the change that is the film's if the rest is a transducer of the bearing; 0 to 1
        within its uncertainty. None if it is unknown, or if no such mixture agrees with the motion.
    film_share_std
        Standard uncertainty of `film_share`.
    shaft_change, bearing_change
        Motion of shaft and bearing over the motion that was expected, in ln.
    """

    cause: Cause
    reason: str
    film_share: float | None = None
    film_share_std: float | None = None
    shaft_change: float | None = None
    bearing_change: float | None = None


MIN_RELATIVE_CHANGE = 0.4
"""Fraction of the change of the alarmed film from which on another film has changed with it."""

MAX_MISFIT = 30.0
"""Sum over all films of squared deviations, in standard uncertainties, up to which a cause agrees
with the motion of the shaft. In simulated lives 95 % of the healthy means lie below."""

SCALES = np.linspace(0.8, 1.6, 9)
"""Multiples of a predicted motion that agree with the prediction: the response was learned where
films changed together, and is not exact where one changes alone. In simulated lives a film of one
bearing moved the shaft by 1.0 to 1.35 times the predicted motion."""

SPREAD = 0.15
"""Error of a predicted motion at each film, as a fraction of its rms over all films."""

SHARE_SPREAD, COVERAGE = 0.3, 2.0
"""Relative standard uncertainty of a share from the prediction, and the number of standard
uncertainties by which a share may lie outside 0 to 1."""

FILM_REASON = "the shaft moves as it does with films of the stiffness that is measured"
OIL_REASON = "all films changed alike, and the shaft moves as it does with such films"
TRANSDUCER_REASON = "the shaft moves as if the film had not changed"
PROBE_REASON = "shaft probes read more or less than films and other probes account for"
BRACKET_REASON = "the shaft moves as if the bracket had changed"
ALIKE_REASON = "all films changed alike; look at oil and cooling first"
ALONE_REASON = "whether other films changed with it is not known"
AMBIGUOUS_REASON = "shaft motion agrees with more than one cause"
NO_FIT_REASON = "shaft motion agrees with no single cause"


@dataclass(frozen=True, eq=False)
class UnitReadings:
    """Settled readings of all films of a unit at the same times: all (n_films, n), NaN if missing.

    Parameters
    ----------
    ln_k, ln_shaft
        ln of stiffness and of shaft motion at 1×.
    deviation
        Of stiffness from its baseline.
    rise
        Rise of the baseline's ln k with ln of the eccentricity ratio.
    """

    ln_k: FloatArray
    ln_shaft: FloatArray
    deviation: FloatArray
    rise: FloatArray
    attitude_deg: FloatArray

    def columns(self, wanted: npt.NDArray[np.bool_ | np.int64]) -> "UnitReadings":
        """Some of the times, by mask or number."""
        return UnitReadings(*(getattr(self, f.name)[:, wanted] for f in fields(self)))


def attribute(
    film: FilmDirection,
    response: ShaftResponse | None,
    readings: UnitReadings,
    bracket_n_per_m: FloatArray | None = None,
) -> Attribution:
    """Find the cause of a change of stiffness of a film.

    Parameters
    ----------
    readings
        The newest readings for which the film has a deviation, about `MEAN_READINGS` of them.
    bracket_n_per_m : (n_films,), optional
        Stiffness of the brackets that measured stiffness is computed with. Without it a loose
        bracket cannot be ruled out, and no film is found to have become stiffer.
    """
    if response is None or film not in response.places:
        return Attribution(Cause.UNKNOWN, "the response of the shaft has not been learned")
    row = response.places.index(film)
    usable = np.all(np.isfinite(readings.ln_k) & np.isfinite(readings.ln_shaft), axis=0)
    usable &= np.isfinite(readings.deviation[row])
    if not usable.any():
        return Attribution(Cause.UNKNOWN, "stiffness or shaft motion is not known everywhere")
    seen = _Residuals(row, response, readings.columns(usable))
    cause, reason = _cause(seen, bracket_n_per_m)
    unchanged = seen.if_unchanged
    shaft = float(unchanged[row] * seen.std[row])
    bearing = shaft + float(np.mean(seen.change[row]))
    share, share_std = seen.film_share()
    return Attribution(cause, reason, share, share_std, shaft, bearing)


@dataclass(frozen=True, eq=False)
class _Residuals:
    """Distance (n_films,) of the motion from each cause's, in standard uncertainties."""

    row: int
    response: ShaftResponse
    readings: UnitReadings

    @cached_property
    def std(self) -> FloatArray:
        """(n_films,) standard uncertainty of means of that many readings."""
        few = max(1.0, MEAN_READINGS / self.readings.ln_k.shape[1])
        return np.asarray(np.array(self.response.std) * few**0.5)

    @cached_property
    def change(self) -> FloatArray:
        """(n_films, n) deviations of the films that changed together; zero for the others."""
        deviation, known = self.readings.deviation, np.isfinite(self.readings.deviation)
        mean = np.nansum(deviation, axis=1) / np.maximum(np.sum(known, axis=1), 1)
        together = np.sign(mean) == np.sign(mean[self.row])
        together &= np.abs(mean) >= MIN_RELATIVE_CHANGE * abs(mean[self.row])
        change = np.where(known, deviation, mean[:, np.newaxis])
        return np.where(together[:, np.newaxis], change, 0.0)

    @cached_property
    def if_film(self) -> FloatArray:
        """Residual if films have the measured stiffness."""
        return self._residual(self.readings.ln_k)

    @cached_property
    def if_unchanged(self) -> FloatArray:
        """Residual if neither a film nor a shaft probe has changed."""
        return self._residual(self.readings.ln_k - self.change)

    def probe_misfit(self) -> float:
        """Misfit if the bearing's shaft probes read wrong; NaN if that is unknown."""
        gain, ln_k = self._probe_gain(), self.readings.ln_k
        if not np.all(np.isfinite(gain)):
            return float("nan")
        own = np.mean(gain - np.mean(gain, axis=0), axis=1) / self.std
        residual = (self._residual(ln_k + a * gain, a * gain) for a in SCALES)
        return min(self.misfit(x, a * own) for a, x in zip(SCALES, residual, strict=True))

    def bracket_misfit(self, bracket_n_per_m: FloatArray | None) -> float:
        """Misfit if brackets have changed as stiffness seems to have; NaN if that is unknown.

        To the rest of the machine, film and bracket in series are one spring; the film's share of
        the motion in its own bearing falls with the stiffness of the bracket.
        """
        if bracket_n_per_m is None:
            return float("nan")
        k = np.exp(self.readings.ln_k - self.change)
        stated = bracket_n_per_m[:, np.newaxis]
        true = stated * np.exp(-self.change)
        alike = 1.0 / (1.0 / k + 1.0 / true - 1.0 / stated)
        own = np.log((1.0 + alike / stated) / (1.0 + k / true))
        return self.scaled_misfit(self._residual(np.log(alike), own))

    def film_share(self) -> tuple[float, float] | tuple[None, None]:
        """Share of the film in a mixture with a bearing transducer, with its uncertainty."""
        step = self.if_unchanged - self.if_film
        size = float(np.sum(step**2))
        if size == 0.0:
            return None, None
        share = float(np.sum(self.if_unchanged * step)) / size
        std = float(np.hypot(size**-0.5, SHARE_SPREAD * share))
        is_possible = -COVERAGE * std <= share <= 1.0 + COVERAGE * std
        is_possible &= self.misfit(self.if_unchanged - share * step, share * step) <= MAX_MISFIT
        return (share, std) if is_possible else (None, None)

    def bearings(self, rows: npt.NDArray[np.bool_]) -> frozenset[str]:
        """Bearings of some of the films."""
        places = zip(self.response.places, rows.tolist(), strict=True)
        return frozenset(bearing for (bearing, _), is_wanted in places if is_wanted)

    def _probe_gain(self) -> FloatArray:
        """(n_films, n) ln of the gain of the bearing's probes that would explain the deviations.

        With gains g the film reads softer by g, and the shaft seems to run further out by
        g_x cos² + g_y sin² of the attitude angle, where the baseline is stiffer.
        """
        bearing = self.response.places[self.row][0]
        pair = [i for i, (other, _) in enumerate(self.response.places) if other == bearing]
        angle = np.radians(self.readings.attitude_deg[self.row])
        outward = np.stack([np.cos(angle) ** 2, np.sin(angle) ** 2])[: len(pair)]
        matrix = np.eye(len(pair)) + np.einsum("in,jn->nij", self.readings.rise[pair], outward)
        deviation = np.nan_to_num(self.readings.deviation[pair])  # unknown in y: as if not changed
        gain = np.zeros_like(self.readings.ln_k)
        gain[pair] = np.linalg.solve(matrix, -deviation.T[:, :, np.newaxis])[:, :, 0].T
        return gain

    def _residual(self, ln_k: FloatArray, own: FloatArray | float = 0.0) -> FloatArray:
        """Residual of the shares of motion, for a stiffness and an `own` excess of each film."""
        motion = self.readings.ln_shaft - own
        left = motion - np.mean(motion, axis=0) - self.response.expected(ln_k)
        return np.asarray(np.mean(left, axis=1) / self.std)

    def scaled_misfit(self, residual: FloatArray) -> float:
        """Smallest misfit over the multiples of a predicted motion."""
        step = self.if_unchanged - residual
        return min(self.misfit(self.if_unchanged - a * step, a * step) for a in SCALES)

    def misfit(self, residual: FloatArray, predicted: FloatArray | float = 0.0) -> float:
        """Sum of squares, with the uncertainty of the prediction."""
        spread = SPREAD**2 * np.mean((predicted * self.std) ** 2) / self.std**2
        return float(np.sum(residual**2 / (1.0 + spread)))


def _cause(seen: _Residuals, bracket_n_per_m: FloatArray | None) -> tuple[Cause, str]:
    misfits = {
        TRANSDUCER_REASON: seen.misfit(seen.if_unchanged),
        PROBE_REASON: seen.probe_misfit(),
    }
    # brackets come loose, which looks like stiffer films; they do not stiffen
    if np.mean(seen.change[seen.row]) > 0.0:
        misfits[BRACKET_REASON] = seen.bracket_misfit(bracket_n_per_m)
    known = seen.bearings(np.asarray(np.any(np.isfinite(seen.readings.deviation), axis=1)))
    changed = seen.bearings(np.asarray(np.any(seen.change != 0.0, axis=1)))
    is_film = seen.scaled_misfit(seen.if_film) <= MAX_MISFIT
    agreeing = [reason for reason, misfit in misfits.items() if misfit <= MAX_MISFIT]
    only_film = is_film and all(misfit > MAX_MISFIT for misfit in misfits.values())
    if changed == known and len(known) > 1:
        # transducers of all bearings hardly change together
        return (Cause.OIL, OIL_REASON) if only_film else (Cause.UNKNOWN, ALIKE_REASON)
    if only_film:
        return (Cause.FILM, FILM_REASON) if len(known) > 1 else (Cause.UNKNOWN, ALONE_REASON)
    if agreeing and not is_film:
        return Cause.BRACKET_OR_TRANSDUCER, min(agreeing, key=misfits.__getitem__)
    return Cause.UNKNOWN, AMBIGUOUS_REASON if is_film else NO_FIT_REASON
