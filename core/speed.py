"""The running speed, and how it is known."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from core.arrays import FloatArray
from core.lines import peak_frequency_hz
from core.machine import Unit
from core.quality import Reading, Reason, missing, uncertain
from core.units import hz_from_rpm, rpm_from_hz

LINE_SEARCH = (0.85, 1.15)
"""Where the 1× line is looked for without a speed channel, in multiples of the rated speed."""


class SpeedSource(StrEnum):
    """Where the running speed came from; shown with every result."""

    SLOW_CHANNEL = "slow_channel"
    LINE = "line"
    RATED = "rated"


@dataclass(frozen=True)
class Speed:
    """Running speed in r/min; without a value when the machine stands."""

    rpm: Reading
    source: SpeedSource


def running_speed(
    unit: Unit,
    slow: Mapping[str, Reading],
    frequency_hz: FloatArray,
    shaft_power: FloatArray,
    min_speed_fraction: float,
) -> Speed:
    """Take the best speed there is: the speed channel, else the 1× line, else the rated value.

    Parameters
    ----------
    slow
        Slow readings of the same time.
    frequency_hz, shaft_power : (n_lines,)
        Power of the shaft channels together, in which the 1× line is looked for.
    min_speed_fraction
        Share of the rated speed below which the machine counts as standing.
    """
    measured = slow.get(unit.speed_channel) if unit.speed_channel else None
    if measured is not None and measured.value is not None:
        if measured.value < min_speed_fraction * unit.rated_speed_rpm:
            return Speed(missing(Reason.STANDSTILL), SpeedSource.SLOW_CHANNEL)
        return Speed(measured, SpeedSource.SLOW_CHANNEL)
    rated_hz = hz_from_rpm(unit.rated_speed_rpm)
    band_hz = (LINE_SEARCH[0] * rated_hz, LINE_SEARCH[1] * rated_hz)
    line_hz = peak_frequency_hz(shaft_power, frequency_hz, band_hz)
    doubtful = uncertain(Reason.SPEED_UNKNOWN)
    if line_hz is not None:
        return Speed(Reading(rpm_from_hz(line_hz), doubtful), SpeedSource.LINE)
    return Speed(Reading(unit.rated_speed_rpm, doubtful), SpeedSource.RATED)
