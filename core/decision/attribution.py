"""What changed a stiffness: the film, or bracket and transducers.

Stiffness is |bracket motion| over |shaft motion| times the bracket's stiffness, so that
Δln k = Δln X_b − Δln U at 1×. A softer film lets the shaft move more, and passes on as much force
as before or less; a transducer or a bracket that changes leaves the shaft's motion alone. What all
amplitudes have in common (the unbalance, for one) is taken off first. Which part of the change the
shaft has tells the two apart.
"""

import statistics
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeAlias

Place: TypeAlias = tuple[str, str]
"""Bearing and direction."""


class Cause(StrEnum):
    """What a change of stiffness is put down to."""

    FILM = "film"
    BRACKET_OR_TRANSDUCER = "bracket_or_transducer"
    BOTH = "both"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Movement:
    """Mean deviation of a quantity from its baseline, in ln, with its standard uncertainty."""

    change: float
    std: float


@dataclass(frozen=True)
class Movements:
    """What moved at one place, on one time scale; None where it is not known."""

    stiffness: Movement | None
    shaft: Movement | None
    bearing: Movement | None


@dataclass(frozen=True)
class Attribution:
    """What a change is put down to, and from what.

    Parameters
    ----------
    shaft_share
        Part of the change that the shaft's motion accounts for, 1 for a film that passes on the
        same force; None where amplitudes are not known.
    shaft_share_std
        Its standard uncertainty.
    reason
        In a sentence.
    """

    cause: Cause
    reason: str
    shaft_share: float | None = None
    shaft_share_std: float | None = None


FILM_SHARE, BRACKET_SHARE = 0.4, 0.2
"""Shaft share from which on it is the film, and up to which it is not. In the paper's machine a
film that becomes softer by half has a shaft share of 0.7 to 0.8 (Brito et al., Tables 4 and 5)."""

SURE = 2.0
"""Standard uncertainties by which a share must be on its side."""

ALIKE = 0.3
"""Changes that differ by less than this share of their median are alike."""

LEAST_PLACES = 3
"""Places that must change alike for one common cause."""


def attribute(place: Place, movements: Mapping[Place, Movements]) -> Attribution:
    """Say what changed the stiffness at one place.

    Parameters
    ----------
    place
        Where the change was found.
    movements
        Of all places of the machine, on the time scale of that change.
    """
    here = movements[place]
    if here.stiffness is None or here.shaft is None or here.bearing is None:
        return Attribution(Cause.UNKNOWN, "amplitudes of shaft and bearing are not known")
    change, common = here.stiffness.change, _common_change(place, movements)
    by_shaft = -(here.shaft.change - common) / change
    by_bearing = 1.0 - (here.bearing.change - common) / change
    share = (by_shaft + by_bearing) / 2.0
    std = (here.shaft.std + here.bearing.std) / 2.0 / abs(change)
    cause = _cause(share, std)
    reason = _REASONS[cause]
    if cause is Cause.UNKNOWN and _all_alike(movements):
        cause, reason = Cause.BRACKET_OR_TRANSDUCER, "all bearings and directions changed alike"
    return Attribution(cause, reason, share, std)


def _cause(share: float, std: float) -> Cause:
    low, high = share - SURE * std, share + SURE * std
    if share > FILM_SHARE and low > BRACKET_SHARE:
        return Cause.FILM
    if share < BRACKET_SHARE and high < FILM_SHARE:
        return Cause.BRACKET_OR_TRANSDUCER
    return Cause.BOTH if low > BRACKET_SHARE and high < FILM_SHARE else Cause.UNKNOWN


_REASONS = {
    Cause.FILM: "shaft motion changed against the stiffness",
    Cause.BRACKET_OR_TRANSDUCER: "bearing motion changed with the stiffness, shaft motion did not",
    Cause.BOTH: "shaft motion accounts for some of the change, bearing motion for the rest",
    Cause.UNKNOWN: "1× amplitudes scatter too much to tell",
}


def _common_change(place: Place, movements: Mapping[Place, Movements]) -> float:
    """What amplitudes have in common where stiffness has not changed; 0 if that is nowhere."""
    changes = [
        (found.shaft.change + found.bearing.change) / 2.0
        for other, found in movements.items()
        if other != place
        and found.stiffness is not None
        and found.shaft is not None
        and found.bearing is not None
        and abs(found.stiffness.change) < SURE * found.stiffness.std
    ]
    return statistics.median(changes) if len(changes) >= LEAST_PLACES else 0.0


def _all_alike(movements: Mapping[Place, Movements]) -> bool:
    changes = [found.stiffness for found in movements.values() if found.stiffness is not None]
    if len(changes) < LEAST_PLACES:
        return False
    middle = statistics.median(found.change for found in changes)
    return all(
        abs(found.change - middle) < ALIKE * abs(middle) and abs(found.change) > SURE * found.std
        for found in changes
    )
