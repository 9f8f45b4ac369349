"""Running speed and shaft angle from key-phase, speed channel, 1× line or rated speed.

A key-phase must have exactly one pulse per turn in the whole segment. If a pulse is missing, extra
or displaced, all phases would be unreliable, and the segment has no key-phase.
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
"""Hysteresis of pulse detection, to each side of the middle, as a fraction of the pulse height."""

MIN_PULSES = 4
"""Smallest number of pulses in a segment; with fewer, an irregular pulse would not be noticed."""

MAX_DEPARTURE_TURNS = 0.02
"""Largest deviation of a pulse from uniform rotation, in turns (7°)."""

ODD_TURN = (0.75, 1.5)
"""Limits of the time between two pulses, relative to the median; outside, a pulse is extra or
missing."""

OUTER_TURN = 1.1
"""Largest distance, in turns, of the first and the last pulse from the ends of the segment."""

LINE_SEARCH = (0.85, 1.15)
"""Search band of the 1× line in multiples of the expected speed."""


KEY_PHASE_TOLERANCE = 0.02
"""Largest relative difference of the speeds by key-phase and speed channel; also the half-width of
the error of a speed channel that is not confirmed by the 1× line."""

LINE_SPREAD = 0.35
"""Standard uncertainty of an interpolated line frequency in bins, at a noise floor as strong as the
line; it is proportional to the square root of floor power over line power. Simulated machines show
0.28 to 0.38."""


@dataclass(frozen=True)
class KeyPhase:
    """Rotation of the shaft during a segment, from its key-phase pulses.

    Parameters
    ----------
    shaft_angle_rad
        Angle that the shaft has turned, at the first sample, since its mark passed the pick-up;
        0 to 2π.
    speed_rpm, n_pulses
        Mean speed over the segment, and number of pulses in it.
    u_relative
        Relative standard uncertainty of the speed, from the pulses' deviation from uniform
        rotation.
    """

    shaft_angle_rad: float
    speed_rpm: float
    u_relative: float
    n_pulses: int


@dataclass(frozen=True)
class _Line:
    """Running speed by the frequency of the 1× line, and its relative standard uncertainty."""

    rpm: float
    u_relative: float


class SpeedSource(StrEnum):
    """Source of the running speed; shown with every result."""

    KEY_PHASE = "key_phase"
    SLOW_CHANNEL = "slow_channel"
    LINE = "line"
    RATED = "rated"


@dataclass(frozen=True)
class Speed:
    """Running speed and its source.

    Parameters
    ----------
    rpm
        Speed in r/min; a bad reading at standstill.
    budget
        Uncertainty budget; None for the rated speed and for a speed contradicted by another source.
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
    """Return the best available speed: key-phase, else speed channel, 1× line, or rated speed.

    A speed contradicted by the 1× line is uncertain; so is a key-phase speed contradicted by the
    speed channel. An impossible speed is not used.

    Parameters
    ----------
    unit, slow
        Unit, and the mean reading of each slow channel over the segment, by id.
    frequency_hz : (n_lines,)
        Frequencies of the bins; empty for a rack.
    shaft_power : (n_lines,)
        Spectral power summed over the shaft channels, which is searched for the 1× line.
    settings, key_phase
        Limits for speeds and lines; rotation from the key-phase, None without one pulse per turn.
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
    """Return the key-phase speed, uncertain if contradicted by the speed channel, or None."""
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
    """Return the uncertainty budget of a speed measured by key-phase or speed channel.

    The uncertainty of a speed channel follows from its agreement with the 1× line, if available.
    None if the speed is not good.
    """
    if speed.value is None or speed.quality != GOOD:
        return None
    if pulses is not None:
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
    """Return the 1× line near an expected speed; None if it does not exceed the noise floor."""
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
    """Return the uniform rotation fitted to the key-phase pulses of a segment.

    The pulses of `signal` (n_samples,) rise when the mark passes. None if there are too few pulses,
    or a pulse is missing, extra or displaced.
    """
    edges = rising_edges(signal)
    if edges.size < MIN_PULSES or _has_odd_turn(edges, signal.size):
        return None
    # The positions of the pulses have the error, so they are fitted over the turns.
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
    """Return the positions at which a finite signal (n_samples,) rises through its middle value.

    Returns
    -------
    (n_edges,) fractional sample positions, ascending; noise within the hysteresis is ignored. Empty
    for a constant signal.
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
    return np.asarray(last + (middle - signal[last]) / (signal[last + 1] - signal[last]))


def _has_odd_turn(edges: FloatArray, n_samples: int) -> bool:
    """Whether a pulse is missing or extra, also at the ends of the segment."""
    intervals = np.diff(edges)
    usual = float(np.median(intervals))
    outer = max(edges[0], n_samples - 1 - edges[-1])
    is_even = ODD_TURN[0] * usual <= intervals.min() and intervals.max() <= ODD_TURN[1] * usual
    return not (is_even and outer <= OUTER_TURN * usual)
