"""Checks of transducers and operation that need a whole segment or all averaged ones.

Blocks are judged on counts and volts, before calibration; what is judged here shows only in a whole
segment or in all that are averaged.
"""

import math
from dataclasses import dataclass

import numpy as np

from core.arrays import FloatArray
from core.quality import GOOD, Quality, Reading, Reason, bad, missing, uncertain

N_PIECES = 8
"""Pieces of a segment, so that a transducer that stopped in its middle is seen at once."""

MAX_CLIPPED_SHARE = 0.01
"""Of a segment's samples. Up to here single samples are wrong, as of a loose contact: the segment
is left out for the channel, and the others stand. Beyond, the channel does not follow its
signal."""

SURE = 4.0
"""Standard uncertainties by which a measured speed must miss the 1× line: segments are many."""

LOWEST_COUNT, HIGHEST_COUNT = -32768, 32767
"""Ends of a 16-bit converter's range."""


@dataclass(frozen=True)
class SensorLimits:
    """What counts as a failure.

    Parameters
    ----------
    min_counts_rms
        A channel of a turning machine that varies less over an eighth of a segment than this many
        counts of its converter is dead or stuck; a last count that flickers has 0.8.
    dead_counts
        Greatest mean in counts of a channel that gives no voltage at all.
    max_backward_share
        Share of an orbit's 1× power that may turn against the shaft: 0 in a circle, 0.5 on a
        straight line, 1 in a circle whose x and y are swapped.
    max_speed_fraction
        Running speed over rated speed that no turbine reaches, not even running away.
    speed_tolerance
        Relative difference of a measured speed and the 1× line. Beside its line an amplitude reads
        low: by 0.1 % at 0.2 % in 8192 samples of 600 Hz at 92.3 r/min, by 6 % at 1.5 %.
    max_speed_change, max_power_change
        Spread over the averaging time, greatest minus least value, as a share of the mean speed and
        of the rated power: the shaft moves in its bearings with the load, and the film with it.
    """

    min_counts_rms: float = 1.0
    dead_counts: float = 3.0
    max_backward_share: float = 0.7
    max_speed_fraction: float = 2.5
    speed_tolerance: float = 0.002
    max_speed_change: float = 0.02
    max_power_change: float = 0.05


def quietest_rms(samples: FloatArray) -> FloatArray:
    """Least standard deviation (n_channels,) of channels (n_channels, n_samples) over their pieces.

    Raises
    ------
    ValueError
        If there are fewer samples than pieces.
    """
    n_channels, n_samples = samples.shape
    length = n_samples // N_PIECES
    if length == 0:
        raise ValueError(f"needs {N_PIECES} samples or more, got {n_samples}")
    # from the end, so that the newest sample is always looked at
    pieces = samples[:, n_samples - N_PIECES * length :].reshape(n_channels, N_PIECES, length)
    quietest: FloatArray = pieces.std(axis=2, dtype=np.float64).min(axis=1)
    return quietest


def signal_quality(
    rms: float, mean: float, unit_per_count: float, turning: bool, limits: SensorLimits
) -> Quality:
    """Whether a channel moves at all while the machine turns; at standstill nothing is judged.

    Parameters
    ----------
    rms, mean
        Least standard deviation (:func:`quietest_rms`) and mean of a segment, channel's unit.
    unit_per_count
        Of either sign; zero where it is not known: then only a constant signal is a failure.
    """
    count = abs(unit_per_count)
    if not turning or rms > limits.min_counts_rms * count:
        return GOOD
    return bad(Reason.DEAD if abs(mean) <= limits.dead_counts * count else Reason.STUCK)


def level_quality(
    samples: FloatArray, turn_samples: int, ok_limits: tuple[float, float]
) -> Quality:
    """Whether the level (n_samples,) of a transducer without its vibration is within its OK limits.

    A mean over part of a turn follows the shaft, a mean over a turn does not. A level that jumps
    farther than the shaft vibrates is that of a contact that was lost for a moment. Samples that
    are fewer than a turn count as one.
    """
    n_turns = samples.size // turn_samples
    turns = samples[-n_turns * turn_samples :].reshape(max(n_turns, 1), -1)
    means = turns.mean(axis=1)
    reach = 0.5 * float(np.median(np.ptp(turns, axis=1)))
    is_outside = means.min() < ok_limits[0] or means.max() > ok_limits[1]
    jumps = float(np.abs(means - np.median(means)).max()) > reach
    return bad(Reason.SENSOR_FAILURE) if is_outside or jumps else GOOD


def clipped_share(samples: FloatArray, unit_per_count: float) -> float:
    """Share of the samples (n_samples,) of a channel at an end of its converter's range."""
    counts = samples / unit_per_count
    at_end = (counts > HIGHEST_COUNT - 0.5) | (counts < LOWEST_COUNT + 0.5)
    return float(np.mean(at_end))


def backward_share(power_x: float, power_y: float, cross_xy: complex) -> float:
    """Share of an orbit's power that turns from y to x, against the positive sense; 0 to 1.

    With the orbit z = x + iy split into forward and backward circles F and B, |F|² and |B|² are
    (S_xx + S_yy ± 2 Im S_xy) / 4, of the means of |X|², |Y|² and X · conj(Y) at a line. It needs no
    phase reference, and averages like the spectra do.
    """
    total = power_x + power_y
    if total <= 0.0:
        return 0.5
    return float(np.clip(0.5 - cross_xy.imag / total, 0.0, 1.0))


def axes_quality(share: float, rotation_sense: int, limits: SensorLimits) -> Quality:
    """Whether the 1× orbit of a pair of transducers turns with the shaft, by its `backward_share`.

    Unbalance and runout turn with it, whatever the film; an orbit that turns against it has most
    likely its x and y swapped. Stiffness anisotropy can do it too, between two critical speeds, so
    that it is no more than a doubt. To be asked only where the line stands out.
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
    """Speed reading in r/min as far as it can be true: missing where no machine turns like that.

    Parameters
    ----------
    line_rpm
        Speed that the 1× line shows, where it stands out of its surroundings; where it contradicts
        the reading, that is uncertain.
    u_line
        Its standard uncertainty, relative.
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
    """Whether speed and load stood still while the averaged segments were recorded.

    An unknown newest power is uncertain, since an unknown load is not steady.

    Parameters
    ----------
    speed_rpm, power_mw : (n_segments,)
        Mean of each segment, oldest first; NaN where it is not known. Without power the speed alone
        is judged.
    rated_power_mw
        Where it is not known, changes of power are compared with the mean power.
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
    """Mean size of the known values, and greatest minus least; zeros without any."""
    known = [value for value in values.tolist() if math.isfinite(value)]
    return (abs(sum(known) / len(known)), max(known) - min(known)) if known else (0.0, 0.0)
