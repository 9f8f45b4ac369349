"""Vibration of one bearing: broad-band averages over segments, and values of the last seconds."""

import math
from collections.abc import Sequence

from core.machine.unit import Bearing
from core.quality import Level, Reading, Reason, current_mean, missing, worst
from core.spectra.cross_spectrum import BEARING_X, BEARING_Y, SHAFT_X, SHAFT_Y
from core.spectra.overall import RecentReadings
from core.spectra.segments import ORDER1, Segment
from core.stiffness.channel_budget import amplitude_lines
from core.uncertainty import Budget, Budgeted, Found, mean_budget, numbers, with_budgets
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


def overall_readings(
    segments: Sequence[Segment], rows: Sequence[int], bearing: Bearing, number: int
) -> Found:
    """Return the broad-band vibration, averaged over at least one segment, and its budgets.

    Peak-to-peak and maximum displacements are averaged linearly, rms velocities as squares; polls
    have none of them. `rows` are the rows of the bearing's four channels, `number` is the bearing's
    index in the unit.
    """
    if segments[-1].overall is None:
        return dict.fromkeys(OVERALL_NAMES, missing(Reason.NOT_MEASURED)), {}
    found: dict[str, Budgeted] = {}
    grazed = [segments[-1].is_grazed(row) or segments[-1].usable[row] for row in rows]
    for name, place in SHAFT_SPANS.items():
        spans = [segment.spans_um_pp[rows[place]] for segment in segments]
        mean = current_mean(spans, is_grazed=grazed[place])
        found[name] = mean, _mean_budget(mean, spans, bearing, place)
    orbits = [segment.orbits_um_pk[number] for segment in segments]
    mean = current_mean(orbits, is_grazed=all(grazed[:2]))
    found[ORBIT] = mean, _mean_budget(mean, orbits, bearing, SHAFT_X)
    for name, place in BEARING_SPEEDS.items():
        squares = [segment.velocity_squares[rows[place]] for segment in segments]
        mean = _root(current_mean(squares, is_grazed=grazed[place]))
        found[name] = mean, _mean_budget(mean, squares, bearing, place, is_root=True)
    return with_budgets(found)


def recent_readings(
    segments: Sequence[Segment], rows: Sequence[int], rate_hz: float
) -> list[RecentReadings]:
    """Return the vibration of one bearing in the newest parts of segments or polls, oldest first.

    Each entry has the 1× shaft vibration, and that of a segment also the broad-band vibration. The
    last part of a segment also has the bearing velocities over the whole segment. `rows` are the
    rows of the bearing's channels.
    """
    found = []
    for segment in segments:
        recent, overall, stops = segment.recent, segment.overall, segment.recent.stop.tolist()
        for part, stop in enumerate(stops):
            readings = {}
            for place, name in SHAFTS.items():
                row = rows[place]
                order1_um_pk = float(recent.order1_um_pk[part, row])
                readings[f"order1_{name}_um_pk"] = _order1(segment, row, order1_um_pk)
                if overall is not None:
                    is_span = not math.isnan(overall.peak_to_peak_um[row])
                    span = recent.peak_to_peak_um[part, row] if is_span else math.nan
                    readings[f"overall_{name}_um_pp"] = segment.reading((row,), float(span))
            if overall is not None and stop == stops[-1]:
                for name, place in BEARING_SPEEDS.items():
                    readings[name] = segment.velocities_mm_s_rms[rows[place]]
            behind_ns = ns_from_s((segment.stop_index - segment.first_index - stop) / rate_hz)
            found.append(RecentReadings(segment.stop_ns - behind_ns, readings))
    return found


def _order1(segment: Segment, row: int, amplitude_um_pk: float) -> Reading:
    """Return a 1× amplitude with the worse of its own and the speed's quality; missing at rest."""
    quality, speed = segment.order_quality[ORDER1][row], segment.speed.rpm
    if speed.value is None:
        return speed
    if quality.level is Level.BAD:
        return missing(quality.reason)
    return Reading(amplitude_um_pk, worst((quality, speed.quality)))


def _mean_budget(
    reading: Reading, parts: Sequence[Reading], bearing: Bearing, place: int, is_root: bool = False
) -> Budget | None:
    if not reading.value:
        return None
    lines = amplitude_lines(bearing, place, reading.value)
    sensitivity = 0.5 / reading.value if is_root else 1.0
    return mean_budget(reading.value, numbers(parts), lines, sensitivity)


def _root(mean: Reading) -> Reading:
    return mean if mean.value is None else Reading(math.sqrt(max(mean.value, 0.0)), mean.quality)
