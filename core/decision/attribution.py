"""What changed a stiffness: the film, or bracket and transducers.

Stiffness is measured as bracket motion over shaft motion times the bracket's stiffness. A film that
softens lets the shaft move further, as any film of that stiffness does: by how much, a healthy
machine has shown (`core.baseline.response`). If a bracket or transducer changes, films are as they
were, and so is the shaft's motion. Between the two lies the share of a change that is the film's,
which is fitted to the shaft's motion in all bearings and directions at once. A shaft probe changes
its own reading alone.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from core.arrays import FloatArray
from core.baseline.response import Place, ShaftResponse


class Cause(StrEnum):
    """What a change of stiffness is put down to."""

    FILM = "film"
    BRACKET_OR_TRANSDUCER = "bracket_or_transducer"
    BOTH = "both"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Attribution:
    """What a change is put down to, and from what.

    Parameters
    ----------
    film_share
        Part of the change that is the film's, 0 to 1 but for its uncertainty; None if not known.
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


LEAST_FILM, MOST_BRACKET = 0.7, 0.3
"""Share from which on a change is the film's, and up to which it is not."""

SURE = 2.0
"""Standard uncertainties by which a share must be beyond a half."""

CHANGED = 0.4
"""Share of the change at the place that alarms from which on another place has changed with it."""

ODDS = 2.0
"""How many times better a faulty shaft probe must fit than film and bearing transducer."""

REASONS = {
    Cause.FILM: "the shaft moves as it does with films of the stiffness that is measured",
    Cause.BRACKET_OR_TRANSDUCER: "the shaft moves as if the film had not changed",
    Cause.BOTH: "the shaft moves as if the film had changed by less than is measured",
    Cause.UNKNOWN: "shaft motion does not tell",
}
PROBE_REASON = "one shaft probe reads more or less than films and other probes account for"
BRACKET_REASON = "the shaft moves as if the bracket had changed"
ALIKE_REASON = "all bearings and directions changed alike, and shaft motion does not tell"


def attribute(
    place: Place,
    response: ShaftResponse | None,
    ln_k: FloatArray,
    ln_shaft: FloatArray,
    deviation: FloatArray,
    bracket_n_per_m: FloatArray | None = None,
) -> Attribution:
    """Say what changed the stiffness at a place.

    Parameters
    ----------
    bracket_n_per_m : (n_places,), optional
        Stiffness of the brackets that measured stiffness rests on. Without it a bracket that has
        come loose is not told from a film that has become stiffer.
    ln_k, ln_shaft, deviation : (n_places, n)
        Newest settled readings at all places of the response, about `MEAN_READINGS` of them:
        stiffness, shaft motion at 1×, and the deviation of stiffness from its baseline; NaN where
        there is none.
    """
    if response is None or place not in response.places:
        return Attribution(Cause.UNKNOWN, "the response of the shaft has not been learned")
    row = response.places.index(place)
    usable = np.all(np.isfinite(ln_k) & np.isfinite(ln_shaft), axis=0) & np.isfinite(deviation[row])
    if not usable.any():
        return Attribution(Cause.UNKNOWN, "stiffness or shaft motion is not known everywhere")
    change = _changed(row, np.nan_to_num(deviation[:, usable]))
    seen = _Seen(row, response, ln_k[:, usable], ln_shaft[:, usable], change)
    return _attributed(seen, bracket_n_per_m)


def _changed(row: int, deviation: FloatArray) -> FloatArray:
    """(n_places, n) deviations of the places that have changed together, zero of the others."""
    mean = np.mean(deviation, axis=1)
    together = (np.sign(mean) == np.sign(mean[row])) & (np.abs(mean) >= CHANGED * abs(mean[row]))
    return np.where(together[:, np.newaxis], deviation, 0.0)


@dataclass(frozen=True, eq=False)
class _Seen:
    """Readings, and what they leave over under what may have happened."""

    row: int
    response: ShaftResponse
    ln_k: FloatArray
    ln_shaft: FloatArray
    change: FloatArray

    @property
    def std(self) -> FloatArray:
        return np.array(self.response.std)

    @property
    def if_film(self) -> FloatArray:
        """(n_places,) if films are as they are measured; in standard uncertainties."""
        return self._left_over(self.ln_k, 0.0)

    @property
    def if_not(self) -> FloatArray:
        """If no film has changed."""
        return self._left_over(self.ln_k - self.change, 0.0)

    def if_bracket(self, bracket_n_per_m: FloatArray) -> FloatArray:
        """If brackets have changed by all that stiffness seems to have.

        To the rest of the machine, film and bracket in series are one spring; of the motion at the
        place itself, the film has a smaller share the softer the bracket is.
        """
        k = np.exp(self.ln_k - self.change)
        told = bracket_n_per_m[:, np.newaxis]
        true = told * np.exp(-self.change)
        alike = 1.0 / (1.0 / k + 1.0 / true - 1.0 / told)
        own = np.log((1.0 + alike / told) / (1.0 + k / true))
        return self._left_over(np.log(alike), own - np.mean(own, axis=0))

    def probe_misfit(self) -> float:
        """Squares left over if the probe at the place reads wrong, by whatever fits best."""
        alone = np.where(np.arange(self.std.size) == self.row, 1.0, 0.0)
        pattern, if_not = (alone - np.mean(alone)) / self.std, self.if_not
        gain = float(np.sum(pattern * if_not) / np.sum(pattern**2))
        return float(np.sum((if_not - gain * pattern) ** 2))

    def _left_over(self, ln_k: FloatArray, own: FloatArray | float) -> FloatArray:
        share = self.ln_shaft - np.mean(self.ln_shaft, axis=0)
        left = share - self.response.expected(ln_k) - own
        return np.asarray(np.mean(left, axis=1) / self.std)


def _attributed(seen: _Seen, bracket_n_per_m: FloatArray | None) -> Attribution:
    if_not, change = seen.if_not, seen.change
    step = if_not - seen.if_film
    size = float(np.sum(step**2))
    if size == 0.0:
        return Attribution(Cause.UNKNOWN, REASONS[Cause.UNKNOWN])
    share = float(np.sum(if_not * step)) / size
    misfit = float(np.sum((if_not - share * step) ** 2))
    spread = max(1.0, misfit / max(1, if_not.size - 2)) ** 0.5
    cause = _cause(share, spread / size**0.5)
    reason = REASONS[cause]
    if cause is not Cause.BRACKET_OR_TRANSDUCER:
        better = _better(seen, misfit, bracket_n_per_m)
        cause, reason = (Cause.BRACKET_OR_TRANSDUCER, better) if better else (cause, reason)
    if cause is Cause.UNKNOWN and np.all(np.any(change != 0.0, axis=1)):
        cause, reason = Cause.BRACKET_OR_TRANSDUCER, ALIKE_REASON
    shaft = float(if_not[seen.row] * seen.std[seen.row])
    bearing = shaft + float(np.mean(change[seen.row]))
    return Attribution(cause, reason, share, spread / size**0.5, shaft, bearing)


def _better(seen: _Seen, misfit: float, bracket_n_per_m: FloatArray | None) -> str | None:
    """What fits much better than film and bearing transducer, if anything."""
    if seen.probe_misfit() < misfit / ODDS:
        return PROBE_REASON
    if bracket_n_per_m is None or np.mean(seen.change[seen.row]) < 0.0:
        return None  # brackets come loose, which looks like stiffer films; they do not stiffen
    return BRACKET_REASON if np.sum(seen.if_bracket(bracket_n_per_m) ** 2) < misfit else None


def _cause(share: float, std: float) -> Cause:
    if share > LEAST_FILM and share - SURE * std > 0.5:
        return Cause.FILM
    if share < MOST_BRACKET and share + SURE * std < 0.5:
        return Cause.BRACKET_OR_TRANSDUCER
    is_between = MOST_BRACKET <= share <= LEAST_FILM and SURE * std < LEAST_FILM - 0.5
    return Cause.BOTH if is_between else Cause.UNKNOWN
