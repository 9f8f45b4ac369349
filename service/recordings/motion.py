"""Shaft orbit: motion of a shaft in its bearing, from new samples or from a recording."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from acquisition.recordings.manifest import Manifest
from acquisition.recordings.reader import Recording
from core.arrays import FloatArray
from core.condition.shaft_centre import locate_shaft
from core.condition.shaft_readings import probe_axis
from core.machine.channel import Channel, Measurand
from core.machine.unit import Bearing, Unit
from core.quality import Reading, Reason, missing
from core.spectra.orbit import Ellipse, ellipse_of, marks_of, order_phasors, trace_of
from core.spectra.resolution import shaft_matrix
from core.units import hz_from_rpm, ns_from_s, rpm_from_hz, s_from_ns
from service.live.samples import SampleWindow, sample_window
from service.recordings.library import RecordingWindow, window_of

MIN_MARKS = 3
"""Minimum number of key-phase marks from which a speed is computed."""


@dataclass(frozen=True, eq=False)
class Order1:
    """1x component of the shaft motion.

    Parameters
    ----------
    frequency_hz
        Running speed in Hz.
    x_um, y_um
        (n_samples,) displacement at running speed; NaN where too few neighbouring samples exist.
    ellipse
        Ellipse of the 1x orbit in the middle of the window.
    """

    frequency_hz: float
    x_um: FloatArray
    y_um: FloatArray
    ellipse: Ellipse


@dataclass(frozen=True, eq=False)
class ShaftMotion:
    """Motion of a shaft relative to its bearing.

    Parameters
    ----------
    x_um, y_um
        (n_samples,) displacement along the bearing's axes, mean removed; NaN for missing samples.
    centre_um
        Mean position (x, y) of the shaft centre in the clearance circle; None if unknown.
    speed_rpm
        Speed from the key-phase marks, else from the slow channel; None if unknown.
    order1
        1x component; None if the speed is unknown or the samples are too few.
    marks
        Positions of the key-phase marks, as fractional sample numbers from 0; None without a
        key-phase channel.
    """

    window: SampleWindow
    x_um: FloatArray
    y_um: FloatArray
    centre_um: tuple[float, float] | None
    speed_rpm: float | None
    order1: Order1 | None
    marks: FloatArray | None


def channels_for(unit: Unit, bearing: Bearing) -> list[str]:
    """Return the ids of the waveform channels from which the shaft motion is computed."""
    wanted = (
        *(bearing.shaft_x, bearing.shaft_y, bearing.opposite_x, bearing.opposite_y),
        unit.key_phase,
    )
    return [id_ for id_ in wanted if id_ is not None]


def motion_of(window: SampleWindow, unit: Unit, bearing: Bearing) -> ShaftMotion:
    """Return the shaft motion in a window, which must contain the shaft channels of the bearing."""
    channels = {channel.id: channel for channel in unit.channels}
    x_um, y_um = (
        _displacement(window, channels[id_]) for id_ in (bearing.shaft_x, bearing.shaft_y)
    )
    matrix = shaft_matrix(unit, bearing)
    if matrix is not None:
        x_um, y_um = matrix @ np.stack([x_um, y_um])
    marks = _marks(window, channels, unit.key_phase)
    speed_rpm = _speed(window, unit, marks)
    return ShaftMotion(
        window=window,
        x_um=x_um,
        y_um=y_um,
        centre_um=_centre(window, channels, bearing, matrix),
        speed_rpm=speed_rpm,
        order1=_order1(window, x_um, y_um, speed_rpm),
        marks=marks,
    )


def _displacement(window: SampleWindow, channel: Channel) -> FloatArray:
    samples = channel.direction * window.samples[channel.id]
    return samples - _mean(samples) if np.isfinite(samples).any() else samples


def _mean(samples: FloatArray) -> float:
    return float(samples[np.isfinite(samples)].mean())


def _marks(
    window: SampleWindow, channels: dict[str, Channel], key_phase: str | None
) -> FloatArray | None:
    pulses = window.of(key_phase)
    if pulses is None or key_phase is None:
        return None
    return marks_of(channels[key_phase].direction * pulses)


def _speed(window: SampleWindow, unit: Unit, marks: FloatArray | None) -> float | None:
    if marks is not None and marks.size >= MIN_MARKS:
        return rpm_from_hz(window.rate_hz / float(np.median(np.diff(marks))))
    return window.mean_of(unit.speed_channel).value


def _order1(
    window: SampleWindow, x_um: FloatArray, y_um: FloatArray, speed_rpm: float | None
) -> Order1 | None:
    frequency_hz = hz_from_rpm(speed_rpm or 0.0)
    if not 0.0 < frequency_hz < window.rate_hz / 2.0:
        return None
    x, y = (order_phasors(each, window.rate_hz, frequency_hz) for each in (x_um, y_um))
    known = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    if not known.size:
        return None
    middle = known[np.argmin(np.abs(known - x.size // 2))]
    return Order1(
        frequency_hz=frequency_hz,
        x_um=trace_of(x, window.rate_hz, frequency_hz),
        y_um=trace_of(y, window.rate_hz, frequency_hz),
        ellipse=ellipse_of(complex(x[middle]), complex(y[middle])),
    )


def _centre(
    window: SampleWindow,
    channels: dict[str, Channel],
    bearing: Bearing,
    matrix: FloatArray | None,
) -> tuple[float, float] | None:
    near, far = (
        [_gap(window, channels.get(id_ or ""), slow) for id_, slow in pairs]
        for pairs in (
            ((bearing.shaft_x, bearing.gap_x), (bearing.shaft_y, bearing.gap_y)),
            (
                (bearing.opposite_x, bearing.opposite_gap_x),
                (bearing.opposite_y, bearing.opposite_gap_y),
            ),
        )
    )
    x, y = (probe_axis(bearing, near, far, axis) for axis in (0, 1))
    found, _ = locate_shaft(x, y, bearing.clearance_um, bearing.gap_accuracy, matrix=matrix)
    x_um, y_um = (found[f"shaft_centre_{axis}_um"].value for axis in "xy")
    return None if x_um is None or y_um is None else (x_um, y_um)


def _gap(window: SampleWindow, channel: Channel | None, slow_channel: str | None) -> Reading:
    """Return the mean gap in µm, from the slow channel or from a DC-coupled probe."""
    if slow_channel is not None:
        gap_mm = window.mean_of(slow_channel)
        return gap_mm if gap_mm.value is None else Reading(1e3 * gap_mm.value, gap_mm.quality)
    samples = None if channel is None else window.of(channel.id)
    if channel is None or samples is None or channel.measurand is not Measurand.GAP_UM:
        return missing(Reason.NOT_MEASURED)
    if not np.isfinite(samples).any():
        return missing(Reason.SENSOR_FAILURE)
    return Reading(_mean(samples))


class NoMotionError(Exception):
    """Error raised if a recording lacks a needed channel or samples, which the message names."""


@dataclass(frozen=True)
class RecordedMotion:
    """Shaft motion in a time window of a recording.

    Parameters
    ----------
    offset_s
        Start of the window, in seconds from the first sample of the recording.
    total_s
        Duration of the recording in seconds, including gaps.
    """

    motion: ShaftMotion
    offset_s: float
    total_s: float


def recorded_motion(
    recording: Recording, unit: Unit, bearing: Bearing, start_s: float, seconds: float
) -> RecordedMotion:
    """Return the shaft motion in a time window of a recording, with the recorded calibration.

    Raises
    ------
    NoMotionError
        If the recording lacks a shaft channel of the bearing, or samples in the window.
    ConfigError
        If the recording can no longer be read.
    """
    rows = _rows(recording.manifest, unit, bearing)
    window = window_of(recording, start_s, seconds)
    if not window.blocks:
        total_s = s_from_ns(window.stop_ns - window.start_ns)
        raise NoMotionError(
            f"the recording has no samples from {start_s:g} s to {start_s + seconds:g} s;"
            f" its length is {total_s:g} s"
        )
    first_index, n_samples = _indices(window, start_s, seconds)
    samples = sample_window(window.blocks, rows, first_index, n_samples)
    return RecordedMotion(
        motion=motion_of(samples, unit, bearing),
        offset_s=s_from_ns(samples.start_ns - window.start_ns),
        total_s=s_from_ns(window.stop_ns - window.start_ns),
    )


def _rows(manifest: Manifest, unit: Unit, bearing: Bearing) -> Mapping[str, int]:
    recorded = {c.id: (row, c.measurand) for row, c in enumerate(manifest.channels)}
    configured = {channel.id: channel.measurand for channel in unit.channels}
    for id_ in (bearing.shaft_x, bearing.shaft_y):
        if id_ not in recorded:
            raise NoMotionError(f"the recording lacks channel {id_} of bearing {bearing.id}")
        if recorded[id_][1] is not configured[id_]:
            then, now = recorded[id_][1], configured[id_]
            raise NoMotionError(f"channel {id_} was recorded as {then}, but is configured as {now}")
    wanted = channels_for(unit, bearing)
    return {id_: recorded[id_][0] for id_ in wanted if id_ in recorded}


def _indices(window: RecordingWindow, start_s: float, seconds: float) -> tuple[int, int]:
    """Return first sample index and number of the samples of a recording in a time window."""
    first, last = window.blocks[0], window.blocks[-1]
    from_ns = window.start_ns + ns_from_s(start_s)
    skipped = max(0, round(s_from_ns(from_ns - first.start_ns) * first.rate_hz))
    first_index = first.first_index + skipped
    wanted = round(seconds * first.rate_hz)
    return first_index, max(1, min(wanted, last.stop_index - first_index))
