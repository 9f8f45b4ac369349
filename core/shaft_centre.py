"""Where the shaft runs in its bearing: centre, eccentricity ratio and attitude angle from gaps."""

import math
from dataclasses import dataclass

import numpy as np

from core.arrays import FloatArray
from core.probe_axes import GapAccuracy, Growth, ProbeAxes, ProbeAxis
from core.quality import Level, Quality, Reading, missing, worst
from core.uncertainty import Budget, BudgetLine, systematic_line

CLEARANCE = "clearance"

ANY_ANGLE_DEG = 180.0 / math.sqrt(3.0)
"""Standard uncertainty of an angle of which nothing is known."""


@dataclass(frozen=True)
class ShaftCentre:
    """Mean shaft position relative to the centred reference.

    Parameters
    ----------
    x_um, y_um
        Displacement along the bearing axes.
    eccentricity_ratio
        Distance from the centre over the radial clearance.
    attitude_angle_deg
        Direction of the displacement, from the positive x axis towards the positive y axis.
    gap_growth_um
        What all gaps have widened since their references were read; only an axis with two probes
        tells it.
    """

    x_um: Reading
    y_um: Reading
    eccentricity_ratio: Reading
    attitude_angle_deg: Reading
    gap_growth_um: Reading


def shaft_centre(
    gap_um: tuple[Reading, Reading], reference_um: tuple[float, float], clearance_um: float
) -> ShaftCentre:
    """Locate the shaft from two probes on the positive axes, whose gaps shrink as it approaches.

    Parameters
    ----------
    gap_um
        Mean gaps (x, y).
    reference_um
        The gaps with the shaft centred.
    clearance_um
        Radial clearance; must be positive.

    Raises
    ------
    ValueError
        If the clearance is not positive.
    """
    x, y = (ProbeAxis(gap, near) for gap, near in zip(gap_um, reference_um, strict=True))
    return locate_shaft(x, y, clearance_um)


def locate_shaft(
    x: ProbeAxis,
    y: ProbeAxis,
    clearance_um: float,
    accuracy: GapAccuracy | None = None,
    last_growth: Growth | None = None,
) -> ShaftCentre:
    """Locate the shaft from one or two probes on each axis, with uncertainty.

    An axis that has or keeps one probe only cannot tell the shaft's displacement from thermal
    growth. It takes the growth that the other axis measures now, else `last_growth`, else none, and
    says by how much that may be wrong.

    Parameters
    ----------
    clearance_um
        Radial clearance; must be positive.
    accuracy
        Limits of everything that is not exact; by default those of :class:`GapAccuracy`.
    last_growth
        Growth when it was last measured.

    Raises
    ------
    ValueError
        If the clearance is not positive.
    """
    if not clearance_um > 0.0:
        raise ValueError(f"clearance must be positive, got {clearance_um} µm")
    accuracy = accuracy or GapAccuracy()
    axes = ProbeAxes(x, y, accuracy, last_growth)
    position_um = axes.weights @ axes.values_um
    x_um, y_um = (
        _reading(axes.lines(weights), float(value), axis.quality)
        for weights, value, axis in zip(axes.weights, position_um, (x, y), strict=True)
    )
    quality, growth_um = worst((x.quality, y.quality)), axes.growth_um()
    if x_um.value is None or y_um.value is None:
        nowhere = missing(quality.reason)
        return ShaftCentre(x_um, y_um, nowhere, nowhere, growth_um)
    radius_um = math.hypot(x_um.value, y_um.value)
    angle_rad = math.atan2(y_um.value, x_um.value)
    outward = np.array([math.cos(angle_rad), math.sin(angle_rad)])
    return ShaftCentre(
        x_um,
        y_um,
        _eccentricity(axes, outward, radius_um, clearance_um, accuracy, quality),
        _angle(axes, outward, radius_um, math.degrees(angle_rad), quality),
        growth_um,
    )


def _eccentricity(
    axes: ProbeAxes,
    outward: FloatArray,
    radius_um: float,
    clearance_um: float,
    accuracy: GapAccuracy,
    quality: Quality,
) -> Reading:
    ratio = radius_um / clearance_um
    lines = axes.lines(outward @ axes.weights / clearance_um)
    width = systematic_line(CLEARANCE, accuracy.clearance, ratio)
    reading = _reading((*lines, width), ratio, quality)
    if reading.interval_95 is None:
        return reading
    low, high = reading.interval_95
    return Reading(ratio, quality, reading.u_random, reading.u_systematic, (max(low, 0.0), high))


def _angle(
    axes: ProbeAxes, outward: FloatArray, radius_um: float, angle_deg: float, quality: Quality
) -> Reading:
    """Angle with the uncertainty of the motion across it; near the centre any angle may be true."""
    across = np.array([-outward[1], outward[0]]) @ axes.weights
    budget = Budget(angle_deg, axes.lines(across))
    if math.degrees(budget.combined) >= ANY_ANGLE_DEG * radius_um:
        whole_circle = (angle_deg - 180.0, angle_deg + 180.0)
        return Reading(angle_deg, quality, 0.0, ANY_ANGLE_DEG, whole_circle)
    return _reading(axes.lines(math.degrees(1.0) / radius_um * across), angle_deg, quality)


def _reading(lines: tuple[BudgetLine, ...], value: float, quality: Quality) -> Reading:
    if quality.level is Level.BAD:
        return missing(quality.reason)
    budget = Budget(value, lines)
    return Reading(value, quality, budget.random, budget.systematic, budget.interval)
