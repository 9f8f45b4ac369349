"""Quality of a value, modelled on OPC UA: good, uncertain or bad, with a reason."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum, StrEnum
from functools import cache
from operator import attrgetter


class Level(IntEnum):
    """Quality level, ordered from best to worst, so that the maximum is the worst level."""

    GOOD = 0
    UNCERTAIN = 1
    BAD = 2


class Reason(StrEnum):
    """Reason for a quality level. The names are used in the API and in the database."""

    OK = "ok"
    WAITING_FOR_DATA = "waiting_for_data"
    NOT_CONNECTED = "not_connected"
    STALE = "stale"
    SENSOR_FAILURE = "sensor_failure"
    CLIPPED = "clipped"
    NOT_FINITE = "not_finite"
    NOT_MEASURED = "not_measured"
    OUT_OF_RANGE = "out_of_range"
    SPEED_UNKNOWN = "speed_unknown"
    STANDSTILL = "standstill"
    FEW_SEGMENTS = "few_segments"
    NO_VORTEX = "no_vortex"
    OUTSIDE_BAND = "outside_band"
    LOW_COVERAGE = "low_coverage"
    INSUFFICIENT_EXCITATION = "insufficient_excitation"
    POOR_FIT = "poor_fit"
    CHANNEL_DELAY = "channel_delay"
    ESTIMATORS_DISAGREE = "estimators_disagree"
    SWITCHED_OFF = "switched_off"
    DEAD = "dead"
    STUCK = "stuck"
    SWAPPED_AXES = "swapped_axes"
    POLARITY = "polarity"
    SPEED_IMPLAUSIBLE = "speed_implausible"
    NON_STATIONARY = "non_stationary"
    POWER_UNKNOWN = "power_unknown"
    REDUCED_PROBES = "reduced_probes"
    BRACKET_UNKNOWN = "bracket_unknown"


@dataclass(frozen=True)
class Quality:
    """Quality level with its reason."""

    level: Level
    reason: Reason


GOOD = Quality(Level.GOOD, Reason.OK)

_BAD = Level.BAD


@cache
def uncertain(reason: Reason) -> Quality:
    """Return the quality of a doubtful value that may be shown."""
    return Quality(Level.UNCERTAIN, reason)


@cache
def bad(reason: Reason) -> Quality:
    """Return the quality of a value that must not be shown."""
    return Quality(Level.BAD, reason)


_level = attrgetter("level")


def worst(qualities: Iterable[Quality]) -> Quality:
    """Return the worst quality, the first of equally bad ones; good if `qualities` is empty."""
    return max(qualities, key=_level, default=GOOD)


@dataclass(frozen=True)
class Reading:
    """Value with its quality; a bad reading has no value.

    Parameters
    ----------
    u_random, u_systematic
        Standard uncertainties in the unit of the value; None if unknown. The random part differs
        from one result to the next. The systematic part is constant as long as transducers and
        brackets are unchanged, and cancels in the trend of a channel.
    interval_95
        95 % coverage interval; None if unknown.

    Raises
    ------
    ValueError
        If a bad reading has a value, or a usable reading has none.
    """

    value: float | None
    quality: Quality = GOOD
    u_random: float | None = None
    u_systematic: float | None = None
    interval_95: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if (self.value is None) != (self.quality.level is _BAD):
            level = self.quality.level.name.lower()
            raise ValueError(f"a reading of {level} quality cannot have the value {self.value}")


@cache
def missing(reason: Reason) -> Reading:
    """Return a bad reading without a value; `reason` states why the value is missing."""
    return Reading(None, bad(reason))


NOT_MEASURED = missing(Reason.NOT_MEASURED)
"""Reading of a slow channel that is missing from a block."""


def mean_reading(readings: Sequence[Reading], weights: Sequence[float] | None = None) -> Reading:
    """Return the mean of the usable readings, or the newest unusable one if most are unusable.

    `readings` has at least one reading, the oldest first. The weights, such as numbers of samples,
    are equal by default; "most" is more than half of the total weight.
    """
    weights = [1.0] * len(readings) if weights is None else weights
    known = [
        (reading.value, weight, reading.quality)
        for reading, weight in zip(readings, weights, strict=True)
        if reading.value is not None
    ]
    whole = sum([weight for _, weight, _ in known])
    if 2.0 * whole < sum(weights):
        return next(reading for reading in reversed(readings) if reading.value is None)
    # relative to the newest value, so that the mean of constant readings is exact to the last bit
    newest = known[-1][0]
    shift = sum([weight * (value - newest) for value, weight, _ in known])
    return Reading(newest + shift / whole, worst([quality for _, _, quality in known]))


def current_mean(readings: Sequence[Reading], *, is_grazed: bool = False) -> Reading:
    """Return the mean of the usable readings, or the newest reading if it is unusable.

    `readings` has at least one reading, the oldest first. Averages over minutes are shown as
    present values. A channel that has just failed therefore has no value, unless only a few clipped
    samples made its newest reading unusable (`is_grazed`); the mean is then uncertain.
    """
    newest = readings[-1]
    usable = [reading for reading in readings if reading.value is not None]
    if newest.value is not None:
        return mean_reading(usable)
    if not (is_grazed and usable):
        return newest
    mean = mean_reading(usable)
    return replace(mean, quality=worst((mean.quality, uncertain(Reason.CLIPPED))))


AXES = ("xx", "xy", "yx", "yy")
