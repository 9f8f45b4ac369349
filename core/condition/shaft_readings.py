"""Readings of shaft position, slow channels and pad temperatures, averaged over segments.

The pad temperatures indicate the static radial load of a bearing (Brito et al., section 3.3.2): a
load in one direction heats the pads on that side.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from core.arrays import FloatArray
from core.condition.probe_axes import ProbeAxis
from core.condition.shaft_centre import locate_shaft
from core.machine.channel import PAD_TEMPERATURE, Measurand
from core.machine.unit import Bearing, GapAccuracy, Unit
from core.quality import NOT_MEASURED, Reading, Reason, current_mean, missing, uncertain, worst
from core.spectra.resolution import shaft_matrix
from core.spectra.segments import Segment
from core.uncertainty import (
    SHAFT_GAIN,
    Budget,
    Budgeted,
    Found,
    mean_budget,
    numbers,
    systematic_line,
    with_budgets,
)


def position_results(
    unit: Unit, bearing: Bearing, segments: Sequence[Segment], last_growth: Reading | None
) -> Found:
    """Return gaps, shaft centre, eccentricity and attitude with their budgets, by quantity.

    `segments` has at least one segment, the oldest first. `last_growth` is the last measured
    thermal growth; None if it was never measured.
    """
    measured = {
        "gap_x_um": _gap(unit, segments, bearing.shaft_x, bearing.gap_x),
        "gap_y_um": _gap(unit, segments, bearing.shaft_y, bearing.gap_y),
        "opposite_gap_x_um": _gap(unit, segments, bearing.opposite_x, bearing.opposite_gap_x),
        "opposite_gap_y_um": _gap(unit, segments, bearing.opposite_y, bearing.opposite_gap_y),
    }
    gaps, gap_budgets = with_budgets(
        {
            name: (reading, _gap_budget(reading, values, bearing.gap_accuracy))
            for name, (reading, values) in measured.items()
        }
    )
    near, far = tuple(gaps.values())[:2], tuple(gaps.values())[2:]
    x, y = (probe_axis(bearing, near, far, axis) for axis in (0, 1))
    centre, centre_budgets = locate_shaft(
        *(x, y, bearing.clearance_um, bearing.gap_accuracy, last_growth),
        shaft_matrix(unit, bearing),
    )
    return gaps | centre, gap_budgets | centre_budgets


def measures_growth(bearing: Bearing) -> bool:
    """Whether thermal growth can be measured: an axis has opposite probes with references."""
    has_opposite = bearing.opposite_x is not None or bearing.opposite_y is not None
    return has_opposite and bearing.opposite_reference_um is not None


def slow_channels(unit: Unit, bearing: Bearing) -> dict[str, str | None]:
    """Return the slow channel ids of a bearing and its unit, by quantity; None if absent."""
    recorded = {channel.reading: channel.id for channel in unit.slow_channels_of(bearing.id)}
    fixed = {"power_mw": unit.power_channel, "oil_temperature_c": bearing.oil_temperature}
    return fixed | recorded


def slow_result(segments: Sequence[Segment], channel: str | None) -> Budgeted:
    """Return the mean of a slow channel over the segments, with its budget.

    The reading of an absent channel (None) has no value. The uncertainty is due to the scatter,
    without the unknown calibration of the transmitter.
    """
    mean, values = _mean_slow(segments, channel)
    return mean, None if mean.value is None else mean_budget(mean.value, values)


def pad_results(unit: Unit, bearing: Bearing, readings: Mapping[str, Reading]) -> Found:
    """Return the pattern of a bearing's pad temperatures; `readings` are from `slow_result`."""
    pads = [c for c in unit.slow_channels_of(bearing.id) if c.quantity == PAD_TEMPERATURE]
    return pad_pattern([(readings[pad.reading], pad.angle_deg) for pad in pads]), {}


def probe_axis(
    bearing: Bearing, near: Sequence[Reading], far: Sequence[Reading], axis: int
) -> ProbeAxis:
    """Return the probe axis x (`axis` 0) or y (1) of a bearing, from mean gaps in µm.

    `near` and `far` are the gaps (x, y) of the probes and of the opposite probes.
    """
    has_far = (bearing.opposite_x, bearing.opposite_y)[axis] is not None
    if not has_far or bearing.opposite_reference_um is None:
        return ProbeAxis(near[axis], bearing.gap_reference_um[axis])
    return ProbeAxis(
        near[axis], bearing.gap_reference_um[axis], far[axis], bearing.opposite_reference_um[axis]
    )


def _mean_slow(segments: Sequence[Segment], channel: str | None) -> tuple[Reading, FloatArray]:
    if channel is None:
        return missing(Reason.NOT_MEASURED), np.empty(0)
    parts = [segment.slow.get(channel, NOT_MEASURED) for segment in segments]
    return current_mean(parts), numbers(parts)


def _gap(
    unit: Unit, segments: Sequence[Segment], channel: str | None, slow_channel: str | None
) -> tuple[Reading, FloatArray]:
    """Return the mean gap, µm, of a slow channel or a DC-coupled probe, and the averaged values."""
    if slow_channel is not None:
        gap_mm, values_mm = _mean_slow(segments, slow_channel)
        if gap_mm.value is None:
            return gap_mm, values_mm
        return Reading(1e3 * gap_mm.value, gap_mm.quality), 1e3 * values_mm
    rows = [row for row, c in enumerate(unit.channels) if c.id == channel]
    if not rows or unit.channels[rows[0]].measurand is not Measurand.GAP_UM:
        return missing(Reason.NOT_MEASURED), np.empty(0)
    gaps = [segment.means[rows[0]] for segment in segments]
    mean = current_mean(gaps, is_grazed=segments[-1].is_grazed(rows[0]))
    return mean, numbers(gaps)


def _gap_budget(gap: Reading, values_um: FloatArray, accuracy: GapAccuracy) -> Budget | None:
    if gap.value is None:
        return None
    lines = (systematic_line(SHAFT_GAIN, accuracy.gain, gap.value),)
    return mean_budget(gap.value, values_um, lines)


MEAN, EXCESS = "pad_temperature_mean_c", "pad_temperature_excess_k"
VECTOR, DIRECTION = "pad_temperature_vector_k", "pad_temperature_direction_deg"

MAX_CONDITION = 5.0
"""Largest condition number of the fit; above it, the pads cover too small a part of the circle."""


def pad_pattern(pads: Sequence[tuple[Reading, float | None]]) -> dict[str, Reading]:
    """Return the pattern of pad temperatures, by quantity of the catalogue.

    The pattern is the mean, the difference of the hottest pad from the mean, and amplitude and
    direction of the first harmonic ``T(θ) = mean + a cos(θ - direction)``, by least squares. It is
    uncertain if a pad has no reading, and bad with fewer than two pads. The harmonic also needs the
    angles of all pads, and three pads with readings that lie around the shaft.

    Parameters
    ----------
    pads
        Temperature of each pad in °C, and its angle in degrees from x towards y, None if unknown.
    """
    read = [(reading.value, angle) for reading, angle in pads if reading.value is not None]
    if len(read) < 2:
        reason = worst(reading.quality for reading, _ in pads).reason if pads else None
        nothing = NOT_MEASURED if reason in (None, Reason.OK) else missing(reason)
        return dict.fromkeys((MEAN, EXCESS, VECTOR, DIRECTION), nothing)
    qualities = [reading.quality for reading, _ in pads if reading.value is not None]
    quality = worst([*qualities, *([uncertain(Reason.REDUCED_PROBES)] * (len(read) < len(pads)))])
    temperature_c = np.array([value for value, _ in read])
    mean_c = float(temperature_c.mean())
    found = {
        MEAN: Reading(mean_c, quality),
        EXCESS: Reading(float(temperature_c.max()) - mean_c, quality),
        **dict.fromkeys((VECTOR, DIRECTION), NOT_MEASURED),
    }
    angles_deg = [angle for _, angle in read if angle is not None]
    if len(angles_deg) < max(3, len(read)):
        return found
    theta = np.deg2rad(angles_deg)
    terms = np.stack([np.ones_like(theta), np.cos(theta), np.sin(theta)], axis=1)
    if np.linalg.cond(terms) > MAX_CONDITION:
        return found | dict.fromkeys((VECTOR, DIRECTION), missing(Reason.REDUCED_PROBES))
    _, *parts = np.linalg.lstsq(terms, temperature_c, rcond=None)[0].tolist()
    vector = complex(*parts)
    return found | {
        VECTOR: Reading(abs(vector), quality),
        DIRECTION: Reading(float(np.angle(vector, deg=True)), quality),
    }
