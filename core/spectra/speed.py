"""The running speed and the shaft's angle: by key-phase, speed channel, 1× line or rated value.

The whole segment must bear out that the pulses of a key-phase are one a turn: a pulse lost, one too
many or one out of place makes every phase that follows from it a guess, and so there is none.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.checks.sensor_checks import SURE, checked_speed
from core.machine.unit import Unit
from core.quality import GOOD, Reading, Reason, missing, uncertain
from core.spectra.lines import SegmentSettings, peak_frequency_hz
from core.uncertainty import Budget, random_line, systematic_line
from core.units import hz_from_rpm, rpm_from_hz

HYSTERESIS = 0.2
"""A pulse begins this share of its height above the middle, and ends as much below it."""

MIN_PULSES = 4
"""Three turns; fewer would not show an odd one out."""

MAX_DEPARTURE_TURNS = 0.02
"""Farthest that a pulse may lie from its place in an even turning, 7°."""

ODD_TURN = (0.75, 1.5)
"""A turn shorter or longer than these shares of the middle one holds a pulse too many or too
few."""

OUTER_TURN = 1.1
"""The first and the last pulse lie no more turns than this from the ends of the segment."""

LINE_SEARCH = (0.85, 1.15)
"""Where the 1× line is looked for, in multiples of the speed that is expected."""


KEY_PHASE_TOLERANCE = 0.02
"""Relative difference of key-phase and speed channel, which is often no better than this."""

LINE_SPREAD = 0.35
"""Standard uncertainty of an interpolated line in bins, for a floor as strong as the line; it falls
with the root of their powers' ratio. Found on simulated machines: 0.28 to 0.38."""


@dataclass(frozen=True)
class KeyPhase:
    """How the shaft turned during a segment.

    Parameters
    ----------
    shaft_angle_rad
        Angle that it has turned at the first sample since the mark passed the pick-up, 0 to 2π.
    speed_rpm
        Mean over the segment.
    u_relative
        Standard uncertainty of the speed, relative, by how far the pulses lie from an even turning.
    n_pulses
        Pulses in the segment.
    """

    shaft_angle_rad: float
    speed_rpm: float
    u_relative: float = 0.0
    n_pulses: int = 0


@dataclass(frozen=True)
class _Line:
    """Speed that the 1× line shows, with its relative standard uncertainty."""

    rpm: float
    u_relative: float


class SpeedSource(StrEnum):
    """Where the running speed came from; shown with every result."""

    KEY_PHASE = "key_phase"
    SLOW_CHANNEL = "slow_channel"
    LINE = "line"
    RATED = "rated"


@dataclass(frozen=True)
class Speed:
    """Running speed in r/min; without a value when the machine stands.

    Parameters
    ----------
    budget
        Its uncertainty; None for the rated speed and for a speed that another contradicts.
    """

    rpm: Reading
    source: SpeedSource
    budget: Budget | None = None


def running_speed(
    unit: Unit,
    slow: Mapping[str, Reading],
    frequency_hz: FloatArray,
    shaft_power: FloatArray,
    settings: SegmentSettings,
    key_phase: KeyPhase | None = None,
) -> Speed:
    """Take the best speed there is: key-phase, else speed channel, else 1× line, else rated value.

    One that the 1× line contradicts is doubted, and so is a key-phase that the speed channel
    contradicts; one that no machine reaches is not used.

    Parameters
    ----------
    slow
        Slow readings of the same time.
    frequency_hz, shaft_power : (n_lines,)
        Power of the shaft channels together, in which the 1× line is looked for.
    key_phase
        What the pulses show, if they are one a turn.
    """
    slow_rpm = slow.get(unit.speed_channel) if unit.speed_channel else None
    for source, measured in (
        (SpeedSource.KEY_PHASE, _pulsed(key_phase, slow_rpm)),
        (SpeedSource.SLOW_CHANNEL, slow_rpm),
    ):
        if measured is None or measured.value is None:
            continue
        if 0.0 <= measured.value < settings.min_speed_fraction * unit.rated_speed_rpm:
            return Speed(missing(Reason.STANDSTILL), source)
        line = _line(measured.value, frequency_hz, shaft_power, settings)
        checked = checked_speed(
            measured,
            line.rpm if line else None,
            unit.rated_speed_rpm,
            settings.sensors,
            line.u_relative if line else 0.0,
        )
        if checked.value is not None:
            pulses = key_phase if source is SpeedSource.KEY_PHASE else None
            return Speed(checked, source, _budget(checked, pulses, line, settings))
    doubtful = uncertain(Reason.SPEED_UNKNOWN)
    line = _line(unit.rated_speed_rpm, frequency_hz, shaft_power, settings)
    if line is not None:
        budget = Budget(line.rpm, (random_line("1× line", line.rpm * line.u_relative),))
        return Speed(Reading(line.rpm, doubtful), SpeedSource.LINE, budget)
    return Speed(Reading(unit.rated_speed_rpm, doubtful), SpeedSource.RATED)


def _pulsed(key_phase: KeyPhase | None, slow_rpm: Reading | None) -> Reading | None:
    """Speed by the key-phase, uncertain where a speed channel contradicts it."""
    if key_phase is None:
        return None
    other_rpm = slow_rpm.value if slow_rpm is not None else None
    if other_rpm is None or abs(other_rpm - key_phase.speed_rpm) <= (
        KEY_PHASE_TOLERANCE * key_phase.speed_rpm
    ):
        return Reading(key_phase.speed_rpm)
    return Reading(key_phase.speed_rpm, uncertain(Reason.SPEED_IMPLAUSIBLE))


def _budget(
    speed: Reading, pulses: KeyPhase | None, line: _Line | None, settings: SegmentSettings
) -> Budget | None:
    """Uncertainty of a measured speed: of its pulses, or of a speed channel's reading.

    A speed channel is as good as its agreement with the 1× line, where there is one.
    """
    if speed.value is None or speed.quality != GOOD:
        return None
    if pulses is not None:
        if not pulses.u_relative > 0.0:
            return None
        std_rpm = speed.value * pulses.u_relative
        return Budget(speed.value, (random_line("key-phase", std_rpm, pulses.n_pulses - 2.0),))
    tolerance = KEY_PHASE_TOLERANCE
    if line is not None:
        tolerance = math.hypot(settings.sensors.speed_tolerance, SURE * line.u_relative)
    return Budget(speed.value, (systematic_line("speed channel", tolerance, speed.value),))


def _line(
    about_rpm: float,
    frequency_hz: FloatArray,
    shaft_power: FloatArray,
    settings: SegmentSettings,
) -> _Line | None:
    """The 1× line near an expected speed, if it stands above its surroundings."""
    about_hz = hz_from_rpm(about_rpm)
    band_hz = (LINE_SEARCH[0] * about_hz, LINE_SEARCH[1] * about_hz)
    line_hz = peak_frequency_hz(shaft_power, frequency_hz, band_hz)
    if line_hz is None:
        return None
    around = (frequency_hz > 0.5 * about_hz) & (frequency_hz < 1.5 * about_hz)
    top = shaft_power[np.argmin(np.abs(frequency_hz - line_hz))]
    floor = float(np.median(shaft_power[around]))
    if top <= settings.min_line_to_floor * floor:
        return None
    bin_hz = float(frequency_hz[1] - frequency_hz[0])
    spread_hz = LINE_SPREAD * bin_hz * math.sqrt(floor / float(top))
    return _Line(rpm_from_hz(line_hz), spread_hz / line_hz)


def read_key_phase(signal: FloatArray, rate_hz: float) -> KeyPhase | None:
    """Fit an even turning to the pulses of a segment.

    Parameters
    ----------
    signal
        (n_samples,) with pulses that rise; the mark passes where they begin.

    Returns
    -------
    None with too few pulses, or with one that is missing, too many or out of its place.
    """
    edges = rising_edges(signal)
    if edges.size < MIN_PULSES or _has_odd_turn(edges, signal.size):
        return None
    # The error lies in where a pulse is found, so that positions are fitted over turns.
    turns = np.arange(edges.size) - (edges.size - 1) / 2.0
    samples_per_turn = float(turns @ edges / (turns @ turns))
    middle = float(edges.mean())
    departure = (edges - middle - samples_per_turn * turns) / samples_per_turn
    if np.abs(departure).max() > MAX_DEPARTURE_TURNS:
        return None
    # slope of a line (Bevington and Robinson 2003, equation 6.23); an edge is known to a sample
    resolution = samples_per_turn**-2 / 12.0
    variance = float(departure @ departure) / (edges.size - 2) + resolution
    turns_at_start = -middle / samples_per_turn - float(turns[0])  # since the first pulse
    return KeyPhase(
        shaft_angle_rad=2.0 * math.pi * (turns_at_start % 1.0),
        speed_rpm=rpm_from_hz(rate_hz / samples_per_turn),
        u_relative=math.sqrt(variance / (turns @ turns)),
        n_pulses=edges.size,
    )


def rising_edges(signal: FloatArray) -> FloatArray:
    """Where a signal rises through the middle between its extremes, in samples, between them too.

    Parameters
    ----------
    signal : (n_samples,)

    Returns
    -------
    (n_edges,) rising; noise smaller than the hysteresis makes no edge.
    """
    low, high = float(signal.min()), float(signal.max())
    middle, margin = (low + high) / 2.0, HYSTERESIS * (high - low)
    if margin == 0.0:
        return np.empty(0)
    clear = np.flatnonzero(np.abs(signal - middle) > margin)
    is_high = signal[clear] > middle
    begins = clear[1:][is_high[1:] & ~is_high[:-1]]
    under: npt.NDArray[np.intp] = np.flatnonzero(signal <= middle)
    last = under[np.searchsorted(under, begins) - 1]
    edges: FloatArray = last + (middle - signal[last]) / (signal[last + 1] - signal[last])
    return edges


def _has_odd_turn(edges: FloatArray, n_samples: int) -> bool:
    """Whether a pulse is missing or one too many; a train that begins late lacks pulses as well."""
    intervals = np.diff(edges)
    usual = float(np.median(intervals))
    outer = max(edges[0], n_samples - 1 - edges[-1])
    is_even = ODD_TURN[0] * usual <= intervals.min() and intervals.max() <= ODD_TURN[1] * usual
    return not (is_even and outer <= OUTER_TURN * usual)
