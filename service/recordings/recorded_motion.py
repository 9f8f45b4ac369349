"""The motion of a shaft at some time of a recording."""

from collections.abc import Mapping
from dataclasses import dataclass

from acquisition.recordings.manifest import Manifest
from acquisition.recordings.reader import Recording
from core.machine.unit import Bearing, Unit
from core.units import ns_from_s, s_from_ns
from service.live.shaft_stretch import stretch_of
from service.recordings.motion import ShaftMotion, channels_for, motion_of
from service.recordings.window import RecordingWindow, window_of


class NoMotionError(Exception):
    """A recording does not hold what is asked of it; the message says what it lacks."""


@dataclass(frozen=True)
class RecordedMotion:
    """A motion with its place in a recording.

    Parameters
    ----------
    offset_s
        From the first sample of the recording to the first of the motion.
    total_s
        Length of the recording, holes included.
    """

    motion: ShaftMotion
    offset_s: float
    total_s: float


def recorded_motion(
    recording: Recording, unit: Unit, bearing: Bearing, start_s: float, seconds: float
) -> RecordedMotion:
    """Read the motion in a stretch of a recording, with the calibration of then.

    Raises
    ------
    NoMotionError
        If the bearing's shaft channels are not in it, or no samples at that time.
    ConfigError
        If it cannot be read any more.
    """
    rows = _rows(recording.manifest, unit, bearing)
    window = window_of(recording, start_s, seconds)
    if not window.blocks:
        total_s = s_from_ns(window.stop_ns - window.start_ns)
        raise NoMotionError(
            f"it has no samples from {start_s:g} s on for {seconds:g} s; it is {total_s:g} s long"
        )
    first_index, n_samples = _indices(window, start_s, seconds)
    stretch = stretch_of(window.blocks, rows, first_index, n_samples)
    return RecordedMotion(
        motion=motion_of(stretch, unit, bearing),
        offset_s=s_from_ns(stretch.start_ns - window.start_ns),
        total_s=s_from_ns(window.stop_ns - window.start_ns),
    )


def _rows(manifest: Manifest, unit: Unit, bearing: Bearing) -> Mapping[str, int]:
    recorded = {c.id: (row, c.measurand) for row, c in enumerate(manifest.channels)}
    configured = {channel.id: channel.measurand for channel in unit.channels}
    for id_ in (bearing.shaft_x, bearing.shaft_y):
        if id_ not in recorded:
            raise NoMotionError(f"it has no channel {id_}, which bearing {bearing.id} needs")
        if recorded[id_][1] is not configured[id_]:
            then, now = recorded[id_][1], configured[id_]
            raise NoMotionError(f"channel {id_} is recorded as {then}, and configured as {now}")
    wanted = channels_for(unit, bearing)
    return {id_: recorded[id_][0] for id_ in wanted if id_ in recorded}


def _indices(window: RecordingWindow, start_s: float, seconds: float) -> tuple[int, int]:
    """First index and number of the samples asked for, as far as there are any."""
    first, last = window.blocks[0], window.blocks[-1]
    from_ns = window.start_ns + ns_from_s(start_s)
    skipped = max(0, round(s_from_ns(from_ns - first.start_ns) * first.rate_hz))
    first_index = first.first_index + skipped
    wanted = round(seconds * first.rate_hz)
    return first_index, max(1, min(wanted, last.stop_index - first_index))
