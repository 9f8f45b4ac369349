"""Checks of transducers and of steady operation, over one segment or all averaged segments.

`core.checks.channels` checks short cells of samples before calibration.
"""

import math
from dataclasses import dataclass

import numpy as np

from core.arrays import FloatArray
from core.checks.channels import COUNTS_FULL_SCALE
from core.quality import GOOD, Quality, Reading, Reason, bad, missing, uncertain

N_PIECES = 8
"""Number of pieces into which a segment is cut, to detect a transducer that failed within it."""

MAX_CLIPPED_SHARE = 0.01
"""Largest fraction of clipped samples in a segment that counts as isolated errors, for example of a
loose contact: only this segment of the channel is left out. Above it, the channel is faulty."""

SURE = 4.0
"""Coverage factor for the uncertainty of the speed in the speed check; large, because many segments
are checked."""


@dataclass(frozen=True)
class SensorLimits:
    """Limits of the sensor checks.

    Parameters
    ----------
    min_counts_rms
        Smallest standard deviation of a live channel over an eighth of a segment while the machine
        turns, in converter counts. At or below it, the channel is dead or stuck. A constant signal
        that flickers by ± 1 count has 0.8.
    dead_counts
        Largest absolute mean, in counts, of a dead channel, which delivers no voltage.
    max_backward_share
        Largest accepted share of backward 1× power of an orbit: 0 for a forward circle, 0.5 for a
        straight line, 1 for a circle with swapped x and y.
    max_speed_fraction
        Running speed over rated speed above which a speed is implausible, even at runaway.
    speed_tolerance
        Accepted relative difference between measured speed and 1× line. An amplitude at a wrong
        speed reads low: by 0.1 % at 0.2 % in 8192 samples of 600 Hz at 92.3 r/min, by 6 % at 1.5 %.
    max_speed_change
        Largest accepted range (maximum minus minimum) of the speed over the averaging time,
        relative to the mean speed.
    max_power_change
        Largest accepted range of the power, relative to the rated power. The shaft position and the
        film change with the load.
    """

    min_counts_rms: float = 1.0
    dead_counts: float = 3.0
    max_backward_share: float = 0.7
    max_speed_fraction: float = 2.5
    speed_tolerance: float = 0.002
    max_speed_change: float = 0.02
    max_power_change: float = 0.05


def quietest_rms(samples: FloatArray) -> FloatArray:
    """Return the standard deviation of each channel (n_channels,) in its quietest piece.

    `samples` (n_channels, n_samples) are divided into `N_PIECES` pieces of at least one sample.
    """
    n_channels, n_samples = samples.shape
    length = n_samples // N_PIECES
    # aligned to the end, so that the newest sample is always included
    pieces = samples[:, n_samples - N_PIECES * length :].reshape(n_channels, N_PIECES, length)
    return np.asarray(pieces.std(axis=2, dtype=np.float64).min(axis=1))


def signal_quality(
    rms: float, mean: float, unit_per_count: float, turning: bool, limits: SensorLimits
) -> Quality:
    """Return the quality of a signal: bad if dead or stuck while the machine turns.

    Parameters
    ----------
    rms
        Smallest standard deviation of a segment (:func:`quietest_rms`), in the channel's unit.
    mean
        Mean of the segment, in the channel's unit.
    unit_per_count
        Unit per count, of either sign; 0 if unknown, then only a constant signal is a failure.
    turning, limits
        Whether the shaft turns (at standstill every signal is good), and limits of the check.
    """
    count = abs(unit_per_count)
    if not turning or rms > limits.min_counts_rms * count:
        return GOOD
    return bad(Reason.DEAD if abs(mean) <= limits.dead_counts * count else Reason.STUCK)


def level_quality(
    samples: FloatArray, turn_samples: int, ok_limits: tuple[float, float]
) -> Quality:
    """Return the quality of a transducer's DC level: bad if a mean over a turn is not OK.

    Means over whole turns of `samples` (n_samples,) do not contain the vibration. They must be
    within `ok_limits` (lowest, highest; in the unit of the samples). A mean that jumps farther than
    the shaft vibrates indicates a contact that was lost for a moment. Fewer samples than one turn
    (`turn_samples`) count as one turn.
    """
    n_turns = samples.size // turn_samples
    turns = samples[-n_turns * turn_samples :].reshape(max(n_turns, 1), -1)
    means = turns.mean(axis=1)
    reach = 0.5 * float(np.median(np.ptp(turns, axis=1)))
    is_outside = means.min() < ok_limits[0] or means.max() > ok_limits[1]
    jumps = float(np.abs(means - np.median(means)).max()) > reach
    return bad(Reason.SENSOR_FAILURE) if is_outside or jumps else GOOD


def clipped_share(samples: FloatArray, unit_per_count: float) -> float:
    """Return the fraction of samples (n_samples,), in the channel's unit, that are clipped.

    `unit_per_count`, the engineering units per count of the converter, must not be 0.
    """
    counts = samples / unit_per_count
    at_end = (counts > COUNTS_FULL_SCALE - 1.5) | (counts < 0.5 - COUNTS_FULL_SCALE)
    return float(np.mean(at_end))


def backward_share(power_x: float, power_y: float, cross_xy: complex) -> float:
    """Return the fraction, 0 to 1, of an orbit's power that turns from y to x (negative sense).

    `power_x`, `power_y` and `cross_xy` are the means of |X|², |Y|² and X · conj(Y) at a spectral
    line. The orbit x + iy is the sum of a forward and a backward circle with the squared radii
    (power_x + power_y ± 2 Im cross_xy) / 4. The fraction is 0.5 without power.
    """
    total = power_x + power_y
    if total <= 0.0:
        return 0.5
    return float(np.clip(0.5 - cross_xy.imag / total, 0.0, 1.0))


def axes_quality(share: float, rotation_sense: int, limits: SensorLimits) -> Quality:
    """Return the quality of a probe pair: uncertain if its 1× orbit turns against the shaft.

    `share` is the `backward_share` of the orbit; `rotation_sense` is positive for a shaft that
    turns from x to y. Unbalance and runout turn with the shaft. A backward orbit most likely means
    that x and y are swapped, but stiffness anisotropy between two critical speeds can also cause
    it, so the quality is not bad. Use this check only if the 1× line is distinct.
    """
    against = share if rotation_sense > 0 else 1.0 - share
    return uncertain(Reason.SWAPPED_AXES) if against > limits.max_backward_share else GOOD


def checked_speed(
    measured: Reading,
    line_rpm: float | None,
    rated_rpm: float,
    limits: SensorLimits,
    u_line: float = 0.0,
) -> Reading:
    """Return the speed in r/min after plausibility checks; bad if negative or implausibly high.

    Parameters
    ----------
    measured, rated_rpm, limits
        Reading to check, returned unchanged if it has no value; rated speed; limits of the checks.
    line_rpm
        Speed of the 1× line; None without a distinct line. If it differs from the reading by more
        than the tolerance, the result is uncertain.
    u_line
        Relative standard uncertainty of `line_rpm`.
    """
    if measured.value is None:
        return measured
    fraction = measured.value / rated_rpm
    if not 0.0 <= fraction <= limits.max_speed_fraction:
        return missing(Reason.SPEED_IMPLAUSIBLE)
    tolerance = math.hypot(limits.speed_tolerance, SURE * u_line)
    if line_rpm is None or abs(measured.value / line_rpm - 1.0) <= tolerance:
        return measured
    return Reading(measured.value, uncertain(Reason.SPEED_IMPLAUSIBLE))


def stationarity(
    speed_rpm: FloatArray,
    power_mw: FloatArray,
    limits: SensorLimits,
    rated_power_mw: float | None = None,
) -> Quality:
    """Return the data quality: uncertain if speed or power varied by more than its limit.

    The quality is also uncertain if the newest power is unknown, as the load may have changed.

    Parameters
    ----------
    speed_rpm : (n_segments,)
        Mean speed of each segment, oldest first; NaN if unknown.
    power_mw : (n_segments,)
        Mean power of each segment, oldest first; NaN if unknown. An empty array is not judged.
    limits, rated_power_mw
        Largest changes, and the reference of power changes, by default the mean power.
    """
    mean_rpm, spread_rpm = _mean_and_spread(speed_rpm)
    if spread_rpm > limits.max_speed_change * mean_rpm:
        return uncertain(Reason.NON_STATIONARY)
    mean_mw, spread_mw = _mean_and_spread(power_mw)
    if spread_mw > limits.max_power_change * (rated_power_mw or mean_mw):
        return uncertain(Reason.NON_STATIONARY)
    if power_mw.size and not math.isfinite(power_mw[-1]):
        return uncertain(Reason.POWER_UNKNOWN)
    return GOOD


def _mean_and_spread(values: FloatArray) -> tuple[float, float]:
    """Return the absolute mean and the range of the finite values; zeros without finite values."""
    known = [value for value in values.tolist() if math.isfinite(value)]
    return (abs(sum(known) / len(known)), max(known) - min(known)) if known else (0.0, 0.0)
