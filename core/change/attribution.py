"""What changed a stiffness: the film, the oil of all films, or bracket and transducers.

Stiffness is measured as bracket motion over shaft motion times the bracket's stiffness. Each fault
that can change it moves the shaft at 1× in its own way, and a healthy machine has shown how the
shaft moves for any stiffness of its films (`core.baseline.response`):

- a film: as films of the stiffness that is measured;
- an accelerometer: not at all;
- shaft probes: each reads more by what its stiffness reads less, less what the shaft seems to run
  further out by, and the shaft moves as before;
- a loose bracket: as on films in series with a softer bracket.

A cause is named only if the motion agrees with it and with no other.
"""

from dataclasses import dataclass, fields
from enum import StrEnum
from functools import cached_property

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.baseline.response import MEAN_READINGS, Place, ShaftResponse


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
        Part of the change that is the film's if the rest is a transducer of the bearing's, 0 to 1
        but for its uncertainty; None if not known, or if the shaft moves as with no such mixture.
    film_share_std
        Its standard uncertainty.
    shaft_change, bearing_change
        By how much shaft and bearing move more than they would have, in ln.
    """

    cause: Cause
    reason: str
    film_share: float | None = None
    film_share_std: float | None = None
    shaft_change: float | None = None
    bearing_change: float | None = None


CHANGED = 0.4
"""Share of the change at the place that alarms from which on another place has changed with it."""

MOST_MISFIT = 30.0
"""Squared standard uncertainties, summed over all places, up to which a cause agrees with the
motion of the shaft. In simulated lives 95 % of the healthy means lie below."""

PREDICTED = np.linspace(0.8, 1.6, 9)
"""Parts of a predicted motion that agree with the prediction: the response was learned where films
changed together, and is not exact where one changes alone. In simulated lives a film of one bearing
moved the shaft by 1.0 to 1.35 of what was predicted."""

SPREAD = 0.15
"""Part of a predicted motion, rms over the places, by which it may miss at each of them."""

SHARE_SPREAD, SURE = 0.3, 2.0
"""Standard uncertainty of a share from the prediction, relative, and by how many standard
uncertainties a share may lie outside 0 to 1."""

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
class PlaceReadings:
    """Settled readings at all places of a response, at the same times: all (n_places, n).

    NaN where there is no number.

    Parameters
    ----------
    ln_k, ln_shaft
        Stiffness, and shaft motion at 1×.
    deviation
        Of stiffness from its baseline.
    rise
        Of the baseline's ln k with ln of the eccentricity ratio.
    attitude_deg
        Of the shaft from the bearing's centre.
    """

    ln_k: FloatArray
    ln_shaft: FloatArray
    deviation: FloatArray
    rise: FloatArray
    attitude_deg: FloatArray

    def columns(self, wanted: npt.NDArray[np.bool_ | np.int64]) -> "PlaceReadings":
        """Some of the times, by mask or number."""
        return PlaceReadings(*(getattr(self, f.name)[:, wanted] for f in fields(self)))


def attribute(
    place: Place,
    response: ShaftResponse | None,
    readings: PlaceReadings,
    bracket_n_per_m: FloatArray | None = None,
) -> Attribution:
    """Name the cause of a change of stiffness at a place.

    Parameters
    ----------
    readings
        The newest at which the place has a deviation, about `MEAN_READINGS` of them.
    bracket_n_per_m : (n_places,), optional
        Stiffness of the brackets that measured stiffness rests on. Without it a bracket that has
        come loose cannot be ruled out, and no film that has become stiffer is named.
    """
    if response is None or place not in response.places:
        return Attribution(Cause.UNKNOWN, "the response of the shaft has not been learned")
    row = response.places.index(place)
    usable = np.all(np.isfinite(readings.ln_k) & np.isfinite(readings.ln_shaft), axis=0)
    usable &= np.isfinite(readings.deviation[row])
    if not usable.any():
        return Attribution(Cause.UNKNOWN, "stiffness or shaft motion is not known everywhere")
    seen = _Seen(row, response, readings.columns(usable))
    cause, reason = _cause(seen, bracket_n_per_m)
    unchanged = seen.if_unchanged
    shaft = float(unchanged[row] * seen.std[row])
    bearing = shaft + float(np.mean(seen.change[row]))
    share, share_std = seen.film_share()
    return Attribution(cause, reason, share, share_std, shaft, bearing)


@dataclass(frozen=True, eq=False)
class _Seen:
    """Readings, and by how far the motion of the shaft misses what each cause predicts.

    All that is left over is (n_places,), in standard uncertainties.
    """

    row: int
    response: ShaftResponse
    readings: PlaceReadings

    @cached_property
    def std(self) -> FloatArray:
        """(n_places,) of means of that many readings."""
        few = max(1.0, MEAN_READINGS / self.readings.ln_k.shape[1])
        return np.asarray(np.array(self.response.std) * few**0.5)

    @cached_property
    def change(self) -> FloatArray:
        """(n_places, n) deviations of the places that changed together, zero of the others."""
        deviation, known = self.readings.deviation, np.isfinite(self.readings.deviation)
        mean = np.nansum(deviation, axis=1) / np.maximum(np.sum(known, axis=1), 1)
        together = np.sign(mean) == np.sign(mean[self.row])
        together &= np.abs(mean) >= CHANGED * abs(mean[self.row])
        change = np.where(known, deviation, mean[:, np.newaxis])
        return np.where(together[:, np.newaxis], change, 0.0)

    @cached_property
    def if_film(self) -> FloatArray:
        """Left over if films are as they are measured."""
        return self._left_over(self.readings.ln_k)

    @cached_property
    def if_unchanged(self) -> FloatArray:
        """Left over if no film has changed, nor any shaft probe."""
        return self._left_over(self.readings.ln_k - self.change)

    def film_misfit(self) -> float:
        """If films are as they are measured."""
        return self._scaled_misfit(self.if_film)

    def transducer_misfit(self) -> float:
        """If no film has changed."""
        return self._misfit(self.if_unchanged)

    def probe_misfit(self) -> float:
        """If the bearing's shaft probes read wrong; NaN if that cannot be told."""
        gain, ln_k = self._probe_gain(), self.readings.ln_k
        if not np.all(np.isfinite(gain)):
            return float("nan")
        own = np.mean(gain - np.mean(gain, axis=0), axis=1) / self.std
        left_over = (self._left_over(ln_k + a * gain, a * gain) for a in PREDICTED)
        return min(self._misfit(x, a * own) for a, x in zip(PREDICTED, left_over, strict=True))

    def bracket_misfit(self, bracket_n_per_m: FloatArray | None) -> float:
        """If brackets have changed by all that stiffness seems to have; NaN if not known.

        To the rest of the machine, film and bracket in series are one spring; of the motion at the
        place itself, the film has a smaller share the softer the bracket is.
        """
        if bracket_n_per_m is None:
            return float("nan")
        k = np.exp(self.readings.ln_k - self.change)
        stated = bracket_n_per_m[:, np.newaxis]
        true = stated * np.exp(-self.change)
        alike = 1.0 / (1.0 / k + 1.0 / true - 1.0 / stated)
        own = np.log((1.0 + alike / stated) / (1.0 + k / true))
        return self._scaled_misfit(self._left_over(np.log(alike), own))

    def film_share(self) -> tuple[float, float] | tuple[None, None]:
        """Share of the film in a mixture with a bearing transducer, if such a one agrees."""
        step = self.if_unchanged - self.if_film
        size = float(np.sum(step**2))
        if size == 0.0:
            return None, None
        share = float(np.sum(self.if_unchanged * step)) / size
        std = float(np.hypot(size**-0.5, SHARE_SPREAD * share))
        is_possible = -SURE * std <= share <= 1.0 + SURE * std
        is_possible &= self._misfit(self.if_unchanged - share * step, share * step) <= MOST_MISFIT
        return (share, std) if is_possible else (None, None)

    def bearings(self, rows: npt.NDArray[np.bool_]) -> frozenset[str]:
        """Bearings of some places."""
        places = zip(self.response.places, rows.tolist(), strict=True)
        return frozenset(bearing for (bearing, _), is_wanted in places if is_wanted)

    def _probe_gain(self) -> FloatArray:
        """(n_places, n) ln of the gain of the bearing's probes that would make the deviations.

        With gains g the film reads softer by g, and the shaft seems to run further out by
        g_x cos² + g_y sin² of the attitude, where the baseline is stiffer.
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

    def _left_over(self, ln_k: FloatArray, own: FloatArray | float = 0.0) -> FloatArray:
        """Of the shares of motion, with films of this stiffness and by `own` more at each place."""
        motion = self.readings.ln_shaft - own
        left = motion - np.mean(motion, axis=0) - self.response.expected(ln_k)
        return np.asarray(np.mean(left, axis=1) / self.std)

    def _scaled_misfit(self, left_over: FloatArray) -> float:
        """Of a predicted motion, by the part of it that fits best."""
        step = self.if_unchanged - left_over
        return min(self._misfit(self.if_unchanged - a * step, a * step) for a in PREDICTED)

    def _misfit(self, left_over: FloatArray, predicted: FloatArray | float = 0.0) -> float:
        """Sum of squares, with the uncertainty of what was predicted; both in std."""
        spread = SPREAD**2 * np.mean((predicted * self.std) ** 2) / self.std**2
        return float(np.sum(left_over**2 / (1.0 + spread)))


def _cause(seen: _Seen, bracket_n_per_m: FloatArray | None) -> tuple[Cause, str]:
    misfits = {TRANSDUCER_REASON: seen.transducer_misfit(), PROBE_REASON: seen.probe_misfit()}
    # brackets come loose, which looks like stiffer films; they do not stiffen
    if np.mean(seen.change[seen.row]) > 0.0:
        misfits[BRACKET_REASON] = seen.bracket_misfit(bracket_n_per_m)
    known = seen.bearings(np.asarray(np.any(np.isfinite(seen.readings.deviation), axis=1)))
    changed = seen.bearings(np.asarray(np.any(seen.change != 0.0, axis=1)))
    is_film = seen.film_misfit() <= MOST_MISFIT
    agreeing = [reason for reason, misfit in misfits.items() if misfit <= MOST_MISFIT]
    only_film = is_film and all(misfit > MOST_MISFIT for misfit in misfits.values())
    if changed == known and len(known) > 1:
        # transducers of all bearings hardly change together
        return (Cause.OIL, OIL_REASON) if only_film else (Cause.UNKNOWN, ALIKE_REASON)
    if only_film:
        return (Cause.FILM, FILM_REASON) if len(known) > 1 else (Cause.UNKNOWN, ALONE_REASON)
    if agreeing and not is_film:
        return Cause.BRACKET_OR_TRANSDUCER, min(agreeing, key=misfits.__getitem__)
    return Cause.UNKNOWN, AMBIGUOUS_REASON if is_film else NO_FIT_REASON
