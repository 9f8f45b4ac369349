"""Broad-band vibration and 1× phases of one bearing over some segments."""

import cmath
import math
from collections.abc import Callable, Mapping, Sequence

from core.cross_spectrum import BEARING_X, BEARING_Y, SHAFT_X, SHAFT_Y
from core.line_results import AMPLITUDES
from core.quality import Quality, Reading, Reason, current_mean, missing, worst
from core.recent import RecentReadings
from core.segments import ORDER1, Segment
from core.units import ns_from_s

SHAFT_SPANS = {
    "overall_shaft_x_um_pp": SHAFT_X,
    "overall_shaft_y_um_pp": SHAFT_Y,
}
SHAFTS = {SHAFT_X: "shaft_x", SHAFT_Y: "shaft_y"}
BEARING_SPEEDS = {
    "overall_bearing_x_mm_s_rms": BEARING_X,
    "overall_bearing_y_mm_s_rms": BEARING_Y,
}
ORBIT = "overall_shaft_um_pk"

OVERALL_NAMES = (*SHAFT_SPANS, ORBIT, *BEARING_SPEEDS)
"""Broad-band quantities of the catalogue."""

PHASES = {f"order1_{name}_phase_deg": place for name, place in AMPLITUDES.items()}
"""1× phases of the catalogue, with the place of their channel."""


def overall_results(
    segments: Sequence[Segment], rows: Sequence[int], bearing: int
) -> dict[str, Reading]:
    """Broad-band vibration, averaged over the segments.

    Peak-to-peak values and the farthest excursions are averaged as they are, velocities as power.

    Parameters
    ----------
    rows
        Of the bearing's four channels.
    bearing
        Its place in the unit.
    """
    grazed = [segments[-1].is_grazed(row) or segments[-1].usable[row] for row in rows]
    found = {
        name: current_mean(
            [_span(segment, rows[place]) for segment in segments], is_grazed=grazed[place]
        )
        for name, place in SHAFT_SPANS.items()
    }
    found[ORBIT] = current_mean(
        [_orbit(s, rows[:2], bearing) for s in segments], is_grazed=all(grazed[:2])
    )
    return found | {
        name: _root_mean_square(
            [_speed(segment, rows[place]) for segment in segments], is_grazed=grazed[place]
        )
        for name, place in BEARING_SPEEDS.items()
    }


def recent_results(
    segment: Segment, rows: Sequence[int], rate_hz: float
) -> tuple[RecentReadings, ...]:
    """Shaft vibration of the newest parts of a segment, and bearing velocity of all of it.

    Parameters
    ----------
    rows
        Of the bearing's four channels.
    """
    recent, found = segment.recent, []
    if recent is None:
        return ()
    for part, stop in enumerate(recent.stop.tolist()):
        behind_ns = ns_from_s((segment.stop_index - segment.first_index - stop) / rate_hz)
        readings = {}
        for place, name in SHAFTS.items():
            row = rows[place]
            is_span = not math.isnan(segment.overall.peak_to_peak_um[row])
            span = recent.peak_to_peak_um[part, row] if is_span else math.nan
            readings[f"overall_{name}_um_pp"] = _reading(segment, (row,), span)
            readings[f"order1_{name}_um_pk"] = _turning(
                segment, _reading(segment, (row,), recent.order1_um_pk[part, row])
            )
        found.append(RecentReadings(segment.stop_ns - behind_ns, readings))
    speeds = {name: _speed(segment, rows[place]) for name, place in BEARING_SPEEDS.items()}
    newest = found[-1]
    return (*found[:-1], RecentReadings(newest.time_ns, {**newest.readings, **speeds}))


def _turning(segment: Segment, amplitude: Reading) -> Reading:
    """An amplitude at 1×, as far as the speed is known."""
    speed = segment.speed.rpm
    if speed.value is None or amplitude.value is None:
        return speed if speed.value is None else amplitude
    return Reading(amplitude.value, worst((amplitude.quality, speed.quality)))


def phase_results(
    segments: Sequence[Segment],
    rows: Sequence[int],
    quality: Callable[..., Quality | Reading],
) -> Mapping[str, Reading]:
    """Phase of each channel's mean 1× vector when the mark passes the pick-up, 0 to 360°.

    Parameters
    ----------
    quality
        Of what is read from a channel at 1×; without a number, why.
    """
    return {name: _phase(segments, rows[p], quality(p)) for name, p in PHASES.items()}


def phase_of(vector: complex, quality: Quality) -> Reading:
    """The phase of a vector, positive where it leads."""
    return Reading(math.degrees(cmath.phase(vector)) % 360.0, quality)


def _phase(segments: Sequence[Segment], row: int, quality: Quality | Reading) -> Reading:
    if isinstance(quality, Reading):
        return quality
    if segments[-1].shaft_angle_rad is None:
        return missing(Reason.NOT_MEASURED)
    vector = sum(
        complex(s.order_phasors_um_pk[row, ORDER1]) * cmath.exp(-1j * s.shaft_angle_rad)
        for s in segments
        if s.shaft_angle_rad is not None and s.usable[row]
    )
    return phase_of(vector, quality) if vector else missing(Reason.INSUFFICIENT_EXCITATION)


def _span(segment: Segment, row: int) -> Reading:
    return _reading(segment, (row,), segment.overall.peak_to_peak_um[row])


def _speed(segment: Segment, row: int) -> Reading:
    return _reading(segment, (row,), segment.overall.velocity_mm_s_rms[row])


def _orbit(segment: Segment, rows: Sequence[int], bearing: int) -> Reading:
    return _reading(segment, rows, segment.overall.orbit_um_pk[bearing])


def _reading(segment: Segment, rows: Sequence[int], value: float) -> Reading:
    if not segment.usable[list(rows)].all():
        return missing(worst(segment.channel_quality[row] for row in rows).reason)
    if math.isnan(value):
        return missing(Reason.NOT_MEASURED)
    return Reading(float(value), worst(segment.channel_quality[row] for row in rows))


def _root_mean_square(readings: Sequence[Reading], *, is_grazed: bool) -> Reading:
    squares = [r if r.value is None else Reading(r.value**2, r.quality) for r in readings]
    mean = current_mean(squares, is_grazed=is_grazed)
    return mean if mean.value is None else Reading(math.sqrt(max(mean.value, 0.0)), mean.quality)
