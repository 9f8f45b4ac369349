"""Quality of a value after OPC UA: good, uncertain or bad, with the reason."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum, StrEnum


class Level(IntEnum):
    """Ordered from best to worst, so that the worst of several is their maximum."""

    GOOD = 0
    UNCERTAIN = 1
    BAD = 2


class Reason(StrEnum):
    """Why a value is not simply good. The names appear in the API and in the store."""

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


@dataclass(frozen=True)
class Quality:
    """A level with the reason for it."""

    level: Level
    reason: Reason


GOOD = Quality(Level.GOOD, Reason.OK)


def uncertain(reason: Reason) -> Quality:
    """Quality of a value that is shown with doubt."""
    return Quality(Level.UNCERTAIN, reason)


def bad(reason: Reason) -> Quality:
    """Quality of a value that must not be shown."""
    return Quality(Level.BAD, reason)


def worst(qualities: Iterable[Quality]) -> Quality:
    """Quality of a value derived from several: the worst of them, the first among equals."""
    return max(qualities, key=lambda quality: quality.level, default=GOOD)


@dataclass(frozen=True)
class Reading:
    """One number with its quality; a bad reading has no number at all.

    Parameters
    ----------
    u_random, u_systematic
        Standard uncertainties in the unit of the value, where they are known. The random part
        differs from one result to the next; the systematic part stays as long as transducers and
        bracket do, and cancels in a channel's own trend.
    interval_95
        Coverage interval of 95 %, where it is known.

    Raises
    ------
    ValueError
        If a bad reading carries a number or a usable one lacks it.
    """

    value: float | None
    quality: Quality = GOOD
    u_random: float | None = None
    u_systematic: float | None = None
    interval_95: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if (self.value is None) != (self.quality.level is Level.BAD):
            raise ValueError(f"a reading of quality {self.quality} cannot have value {self.value}")


def missing(reason: Reason) -> Reading:
    """A reading without a number, and why."""
    return Reading(None, bad(reason))


NOT_MEASURED = missing(Reason.NOT_MEASURED)
"""Reading of a slow channel that a block does not have."""


def mean_reading(readings: Sequence[Reading], weights: Sequence[float] | None = None) -> Reading:
    """Mean of the usable readings, or the newest unusable one if they are less than half.

    Weights, such as numbers of samples, are equal if not given.
    """
    weights = [1.0] * len(readings) if weights is None else weights
    counted = [
        (reading.value, weight)
        for reading, weight in zip(readings, weights, strict=True)
        if reading.value is not None
    ]
    if 2.0 * sum(weight for _, weight in counted) < sum(weights):
        return next(reading for reading in reversed(readings) if reading.value is None)
    quality = worst(reading.quality for reading in readings if reading.value is not None)
    # about the newest value, so that a reading that stands still stays the same to the last bit
    newest = counted[-1][0]
    shift = sum(weight * (value - newest) for value, weight in counted)
    return Reading(newest + shift / sum(weight for _, weight in counted), quality)


def current_mean(readings: Sequence[Reading], *, is_grazed: bool = False) -> Reading:
    """Mean of the usable readings, or the newest reading if that one is unusable.

    For readings of minutes that are shown as the present: a channel that has just failed has none,
    unless its newest reading is missing only for a few clipped samples (`is_grazed`).
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
