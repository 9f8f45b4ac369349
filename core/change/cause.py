"""Cause of a change of stiffness: the film, the oil of all films, or bracket and transducers.

The measured stiffness is bracket motion over shaft motion, times the bracket stiffness. Each fault
that changes it has a different effect on the 1× shaft motion, which is compared with the response
learned from the healthy machine (`core.change.shaft_response`):

- film: the shaft moves as with films of the measured stiffness;
- accelerometer: the shaft motion does not change;
- shaft probes: the true motion does not change. Each probe reads more by the factor by which its
  stiffness reads less, corrected for the apparent increase of eccentricity;
- loose bracket: the shaft moves as with films in series with a softer bracket.

A cause is reported only if the motion agrees with this cause and with no other.
"""

from dataclasses import dataclass, field, fields
from enum import StrEnum
from functools import cached_property
from typing import Self

import numpy as np
import numpy.typing as npt

from core.arrays import BoolArray, ComplexArray, FloatArray
from core.change.shaft_response import MEAN_READINGS, FilmDirection, ShaftResponse


class Cause(StrEnum):
    """Cause of a change of the measured stiffness."""

    FILM = "film"
    OIL = "oil"
    CLEARANCE = "clearance"
    BRACKET = "bracket"
    TRANSDUCER = "transducer"
    BRACKET_OR_TRANSDUCER = "bracket_or_transducer"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Attribution:
    """Cause of a change of the measured stiffness, with its evidence.

    Parameters
    ----------
    cause, reason
        Cause, and the reason for this conclusion as text.
    film_share
        Fraction of the change due to the film, if the rest is due to a transducer of the bearing; 0
        to 1 within its uncertainty. None if unknown, or if no such mixture agrees with the motion.
    film_share_std
        Standard uncertainty of `film_share`; None if `film_share` is None.
    shaft_change, bearing_change
        ln of the 1× amplitude of shaft and bearing over the expected amplitude; None if unknown.
    """

    cause: Cause
    reason: str
    film_share: float | None = None
    film_share_std: float | None = None
    shaft_change: float | None = None
    bearing_change: float | None = None


MIN_RELATIVE_CHANGE = 0.4
"""Smallest change of another film, relative to that of the alarmed film, to count as changed."""

MAX_MISFIT = 30.0
"""Largest misfit with which a cause agrees with the shaft motion: the sum, over all films, of the
squared residuals in standard uncertainties. In simulations, 95 % of healthy means have less."""

SCALES = np.linspace(0.8, 1.6, 9)
"""Scale factors of the predicted motion that are accepted. The response was learned from films that
changed together, and is inexact if one film changes alone. In simulations, a film of one bearing
moved the shaft by 1.0 to 1.35 times the predicted motion."""

SPREAD = 0.15
"""Error of the predicted motion at each film, as a fraction of its rms over all films."""

SHARE_SPREAD, COVERAGE = 0.3, 2.0
"""`SHARE_SPREAD`: relative standard uncertainty of the film share due to the predicted motion.
`COVERAGE`: number of standard uncertainties by which the film share may lie outside 0 to 1."""

FILM_REASON = "shaft motion agrees with films of the measured stiffness"
OIL_REASON = "all films changed alike, and shaft motion agrees with these changes"
TRANSDUCER_REASON = "shaft motion agrees with an unchanged film"
PROBE_REASON = "amplitudes of the shaft probes disagree with films and other probes"
BRACKET_REASON = "shaft motion agrees with a changed bracket"
ALIKE_REASON = "all films changed alike; check oil and cooling first"
ALONE_REASON = "it is unknown whether other films changed as well"
AMBIGUOUS_REASON = "shaft motion agrees with more than one cause"
NO_FIT_REASON = "shaft motion agrees with no single cause"


@dataclass(frozen=True, eq=False)
class UnitReadings:
    """Settled readings of all films of a unit at common times, (n_films, n) each; NaN if missing.

    Parameters
    ----------
    ln_k
        ln of the measured stiffness in N/m.
    ln_shaft
        ln of the 1× shaft amplitude in µm zero-to-peak.
    deviation
        Deviation of `ln_k` from its baseline.
    rise
        Derivative of the baseline's ln k with respect to ln of the eccentricity ratio.
    attitude_deg
        Attitude angle of the shaft centre.
    motion_um : (2, n_films, n)
        1× phasors of shaft and bearing; empty if the phases are unknown.
    """

    ln_k: FloatArray
    ln_shaft: FloatArray
    deviation: FloatArray
    rise: FloatArray
    attitude_deg: FloatArray
    motion_um: ComplexArray = field(default_factory=lambda: np.empty((2, 0, 0), np.complex128))

    @classmethod
    def of(cls, rows: FloatArray) -> Self:
        """Return readings from an array of their fields in order, (9, n_films, n).

        The last four rows are the real and imaginary part of the shaft's and the bearing's phasor.
        """
        columns = dict(zip((f.name for f in fields(cls)), rows[:5], strict=False))
        return cls(**columns, motion_um=rows[5::2] + 1j * rows[6::2])

    def columns(self, wanted: npt.NDArray[np.bool_ | np.int64] | slice) -> "UnitReadings":
        """Return the readings at the times selected by a mask (n,), indices or a slice."""
        found = {f.name: getattr(self, f.name) for f in fields(self)}
        return UnitReadings(**{k: v[..., wanted] if v.size else v for k, v in found.items()})


def attribute(
    film: FilmDirection,
    response: ShaftResponse | None,
    readings: UnitReadings,
    bracket_n_per_m: FloatArray | None = None,
) -> Attribution:
    """Return the cause of a change of a film's measured stiffness; unknown without a `response`.

    Parameters
    ----------
    film
        Bearing id and direction of the changed film.
    readings
        About `MEAN_READINGS` newest readings for which the film has a deviation.
    bracket_n_per_m : (n_films,), optional
        Bracket stiffness from which the measured stiffness was computed. Without it, a loose
        bracket cannot be excluded, so a stiffer film is never reported as cause.
    """
    if response is None or film not in response.places:
        return Attribution(Cause.UNKNOWN, "the response of the shaft has not been learned")
    row = response.places.index(film)
    usable = np.all(np.isfinite(readings.ln_k) & np.isfinite(readings.ln_shaft), axis=0)
    usable &= np.isfinite(readings.deviation[row])
    if not usable.any():
        return Attribution(Cause.UNKNOWN, "stiffness or shaft motion of some bearing is unknown")
    seen = _Residuals(row, response, readings.columns(usable))
    cause, reason = _cause(seen, bracket_n_per_m)
    shaft = float(seen.if_unchanged[row] * seen.std[row])
    bearing = shaft + float(np.mean(seen.change[row]))
    share, share_std = seen.film_share()
    return Attribution(cause, reason, share, share_std, shaft, bearing)


@dataclass(frozen=True, eq=False)
class _Residuals:
    """Residuals (n_films,) of the shaft motion for each possible cause of the change of film `row`.

    They are divided by their standard uncertainties.
    """

    row: int
    response: ShaftResponse
    readings: UnitReadings

    @cached_property
    def std(self) -> FloatArray:
        """Standard uncertainty (n_films,) of the means; larger below `MEAN_READINGS` readings."""
        few = max(1.0, MEAN_READINGS / self.readings.ln_k.shape[1])
        return np.asarray(np.array(self.response.std) * few**0.5)

    @cached_property
    def change(self) -> FloatArray:
        """Deviations of the films that changed together; 0 for other films (n_films, n)."""
        deviation, known = self.readings.deviation, np.isfinite(self.readings.deviation)
        mean = np.nansum(deviation, axis=1) / np.maximum(np.sum(known, axis=1), 1)
        together = np.sign(mean) == np.sign(mean[self.row])
        together &= np.abs(mean) >= MIN_RELATIVE_CHANGE * abs(mean[self.row])
        change = np.where(known, deviation, mean[:, np.newaxis])
        return np.where(together[:, np.newaxis], change, 0.0)

    @cached_property
    def if_film(self) -> FloatArray:
        """Residual of the shaft motion (n_films,) if the films have the measured stiffness."""
        return self._residual(self.readings.ln_k)

    @cached_property
    def if_unchanged(self) -> FloatArray:
        """Residual of the shaft motion (n_films,) if no film and no shaft probe has changed."""
        return self._residual(self.readings.ln_k - self.change)

    def probe_misfit(self) -> float:
        """Return the misfit if the bearing's shaft probes have wrong gains; NaN if unknown."""
        gain, ln_k = self._probe_gain(), self.readings.ln_k
        if not np.all(np.isfinite(gain)):
            return float("nan")
        own = np.mean(gain - np.mean(gain, axis=0), axis=1) / self.std
        residual = (self._residual(ln_k + a * gain, a * gain) for a in SCALES)
        return min(self.misfit(x, a * own) for a, x in zip(SCALES, residual, strict=True))

    def bracket_misfit(self, bracket_n_per_m: FloatArray | None) -> float:
        """Return the misfit if brackets, not films, changed by the apparent change.

        NaN without a bracket stiffness. For the rest of the machine, film and bracket in series act
        as one spring. The film's share of the motion in its own bearing decreases with the bracket
        stiffness.
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
        """Return the film's fraction of a change that includes a transducer fault.

        Also return its standard uncertainty; None, None if no such mixture agrees with the motion.
        """
        step = self.if_unchanged - self.if_film
        size = float(np.sum(step**2))
        if size == 0.0:
            return None, None
        share = float(np.sum(self.if_unchanged * step)) / size
        std = float(np.hypot(size**-0.5, SHARE_SPREAD * share))
        is_possible = -COVERAGE * std <= share <= 1.0 + COVERAGE * std
        is_possible &= self.misfit(self.if_unchanged - share * step, share * step) <= MAX_MISFIT
        return (share, std) if is_possible else (None, None)

    def bearings(self, rows: BoolArray) -> frozenset[str]:
        """Return the ids of the bearings whose films are selected by the mask `rows` (n_films,)."""
        places = zip(self.response.places, rows.tolist(), strict=True)
        return frozenset(bearing for (bearing, _), is_wanted in places if is_wanted)

    def _probe_gain(self) -> FloatArray:
        """Return ln of the bearing's shaft-probe gains that explain the deviations (n_films, n).

        With ln gains g, the film reads softer by g, and the apparent eccentricity increases by
        g_x cos² + g_y sin² of the attitude angle, where the baseline is stiffer.
        """
        bearing = self.response.places[self.row][0]
        pair = [i for i, (other, _) in enumerate(self.response.places) if other == bearing]
        angle = np.radians(self.readings.attitude_deg[self.row])
        outward = np.stack([np.cos(angle) ** 2, np.sin(angle) ** 2])[: len(pair)]
        matrix = np.eye(len(pair)) + np.einsum("in,jn->nij", self.readings.rise[pair], outward)
        deviation = np.nan_to_num(self.readings.deviation[pair])  # unknown counts as 0
        gain = np.zeros_like(self.readings.ln_k)
        gain[pair] = np.linalg.solve(matrix, -deviation.T[:, :, np.newaxis])[:, :, 0].T
        return gain

    def _residual(self, ln_k: FloatArray, own: FloatArray | float = 0.0) -> FloatArray:
        """Return the mean residual (n_films,) of ln shaft motion for a stiffness (n_films, n).

        `own` is the expected excess motion at each film that the other films do not share.
        """
        motion = self.readings.ln_shaft - own
        left = motion - np.mean(motion, axis=0) - self.response.expected(ln_k)
        return np.asarray(np.mean(left, axis=1) / self.std)

    def scaled_misfit(self, residual: FloatArray) -> float:
        """Return the smallest misfit of a residual (n_films,) over all `SCALES` of the motion."""
        step = self.if_unchanged - residual
        return min(self.misfit(self.if_unchanged - a * step, a * step) for a in SCALES)

    def misfit(self, residual: FloatArray, predicted: FloatArray | float = 0.0) -> float:
        """Return the sum of squared residuals (n_films,), with the uncertainty of the prediction.

        The standard uncertainty of the `predicted` motion (n_films,) is `SPREAD` times its rms.
        """
        spread = SPREAD**2 * np.mean((predicted * self.std) ** 2) / self.std**2
        return float(np.sum(residual**2 / (1.0 + spread)))


def _cause(seen: _Residuals, bracket_n_per_m: FloatArray | None) -> tuple[Cause, str]:
    misfits = {
        TRANSDUCER_REASON: seen.misfit(seen.if_unchanged),
        PROBE_REASON: seen.probe_misfit(),
    }
    # a loose bracket looks like a stiffer film; brackets do not become stiffer
    if np.mean(seen.change[seen.row]) > 0.0:
        misfits[BRACKET_REASON] = seen.bracket_misfit(bracket_n_per_m)
    known = seen.bearings(np.asarray(np.any(np.isfinite(seen.readings.deviation), axis=1)))
    changed = seen.bearings(np.asarray(np.any(seen.change != 0.0, axis=1)))
    is_film = seen.scaled_misfit(seen.if_film) <= MAX_MISFIT
    agreeing = [reason for reason, misfit in misfits.items() if misfit <= MAX_MISFIT]
    only_film = is_film and all(misfit > MAX_MISFIT for misfit in misfits.values())
    if changed == known and len(known) > 1:
        # transducers of all bearings are unlikely to change together
        return (Cause.OIL, OIL_REASON) if only_film else (Cause.UNKNOWN, ALIKE_REASON)
    if only_film:
        return (Cause.FILM, FILM_REASON) if len(known) > 1 else (Cause.UNKNOWN, ALONE_REASON)
    if agreeing and not is_film:
        return Cause.BRACKET_OR_TRANSDUCER, min(agreeing, key=misfits.__getitem__)
    return Cause.UNKNOWN, AMBIGUOUS_REASON if is_film else NO_FIT_REASON
