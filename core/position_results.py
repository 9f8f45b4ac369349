"""Where the shaft ran during the averaged segments, from the gaps of two or four probes."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from core.machine import Bearing, Measurand, Unit
from core.probe_axes import Growth, ProbeAxis
from core.quality import NOT_TOLD, Reading, Reason, current_mean, missing
from core.segments import Segment
from core.shaft_centre import locate_shaft
from core.uncertainty import Budget


def position_results(
    unit: Unit, bearing: Bearing, segments: Sequence[Segment], last_growth: Growth | None
) -> tuple[dict[str, Reading], Mapping[str, Budget]]:
    """Gaps, shaft centre, eccentricity and attitude with their budgets, by quantity.

    Parameters
    ----------
    segments
        Oldest first, at least one.
    last_growth
        Thermal growth of the gaps when it was last measured.
    """
    near = (
        _gap(unit, segments, bearing.shaft_x, bearing.gap_x),
        _gap(unit, segments, bearing.shaft_y, bearing.gap_y),
    )
    far = (
        _gap(unit, segments, bearing.opposite_x, bearing.opposite_gap_x),
        _gap(unit, segments, bearing.opposite_y, bearing.opposite_gap_y),
    )
    x, y = (probe_axis(bearing, near, far, axis) for axis in (0, 1))
    centre = locate_shaft(x, y, bearing.clearance_um, bearing.gap_accuracy, last_growth)
    readings = {
        "gap_x_um": near[0],
        "gap_y_um": near[1],
        "opposite_gap_x_um": far[0],
        "opposite_gap_y_um": far[1],
        "gap_growth_um": centre.gap_growth_um,
        "shaft_centre_x_um": centre.x_um,
        "shaft_centre_y_um": centre.y_um,
        "eccentricity_ratio": centre.eccentricity_ratio,
        "attitude_angle_deg": centre.attitude_angle_deg,
    }
    names = {"x_um": "shaft_centre_x_um", "y_um": "shaft_centre_y_um"}
    budgets = {names.get(key, key): budget for key, budget in centre.budgets.items()}
    return readings, {name: b for name, b in budgets.items() if readings[name].value is not None}


def measured_growth(readings: Mapping[str, Reading]) -> Growth | None:
    """Thermal growth for later, when it can no longer be measured."""
    growth = readings["gap_growth_um"]
    if growth.value is None or growth.interval_95 is None:
        return None
    return Growth(growth.value, (growth.interval_95[1] - growth.interval_95[0]) / 2.0)


def mean_slow(segments: Sequence[Segment], channel: str | None) -> Reading:
    """Mean of a slow channel over the segments."""
    if channel is None:
        return missing(Reason.NOT_MEASURED)
    return current_mean([segment.slow.get(channel, NOT_TOLD) for segment in segments])


def probe_axis(
    bearing: Bearing, near: Sequence[Reading], far: Sequence[Reading], axis: int
) -> ProbeAxis:
    """The probes of an axis (0 is x) with their references.

    Parameters
    ----------
    near, far
        Mean gaps (x, y), µm; of the probes on the positive axes, and of those across the shaft.
    """
    has_far = (bearing.opposite_x, bearing.opposite_y)[axis] is not None
    if not has_far or bearing.opposite_reference_um is None:
        return ProbeAxis(near[axis], bearing.gap_reference_um[axis])
    return ProbeAxis(
        near[axis], bearing.gap_reference_um[axis], far[axis], bearing.opposite_reference_um[axis]
    )


def _gap(
    unit: Unit, segments: Sequence[Segment], channel: str | None, slow_channel: str | None
) -> Reading:
    """Mean gap, from the slow channel or from a DC-coupled probe, with its scatter."""
    if slow_channel is not None:
        gap_mm = mean_slow(segments, slow_channel)
        return gap_mm if gap_mm.value is None else Reading(1e3 * gap_mm.value, gap_mm.quality)
    rows = [row for row, c in enumerate(unit.channels) if c.id == channel]
    if not rows or unit.channels[rows[0]].measurand is not Measurand.GAP_UM:
        return missing(Reason.NOT_MEASURED)
    gaps = [_segment_gap(segment, rows[0]) for segment in segments]
    mean = current_mean(gaps, is_grazed=segments[-1].is_grazed(rows[0]))
    values = [gap.value for gap in gaps if gap.value is not None]
    if mean.value is None or len(values) < 2:
        return mean
    return replace(mean, u_random=float(np.std(values, ddof=1)) / len(values) ** 0.5)


def _segment_gap(segment: Segment, row: int) -> Reading:
    if not segment.usable[row]:
        return missing(segment.channel_quality[row].reason)
    return Reading(float(segment.mean[row]), segment.channel_quality[row])
