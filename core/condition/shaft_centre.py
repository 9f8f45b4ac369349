"""Shaft centre, eccentricity ratio and attitude angle in a bearing, from probe gaps."""

import math
from dataclasses import replace

import numpy as np

from core.arrays import FloatArray
from core.condition.probe_axes import ProbeAxes, ProbeAxis
from core.machine.unit import GapAccuracy
from core.quality import NOT_MEASURED, Level, Reading, missing, worst
from core.uncertainty import Budget, Found, systematic_line

CLEARANCE = "clearance"

HALF_CIRCLE_DEG = 180.0
"""Half-width of the uniform distribution of an unknown attitude angle."""


def locate_shaft(
    x: ProbeAxis,
    y: ProbeAxis,
    clearance_um: float,
    accuracy: GapAccuracy | None = None,
    last_growth: Reading | None = None,
    matrix: FloatArray | None = None,
) -> Found:
    """Locate the shaft from one or two probes on each axis, with uncertainty.

    One probe cannot separate shaft displacement from thermal growth. An axis with one probe uses
    the present growth of the other axis, else the last measured growth, else zero growth, each with
    its uncertainty. `accuracy` is by default `GapAccuracy()`. `matrix` (2, 2) resolves the
    displacements along two probe axes other than x and y into x and y.

    Returns
    -------
    Readings and budgets by quantity: thermal growth of the gaps since their references were read
    (from opposite probes only), displacement along the bearing axes, eccentricity ratio, and
    attitude angle from the positive x axis towards the positive y axis.
    """
    accuracy = accuracy or GapAccuracy()
    axes = ProbeAxes(x, y, accuracy, last_growth)
    quality_x, quality_y = x.quality, y.quality
    if matrix is not None:
        axes.weights = matrix @ axes.weights
        quality_x = quality_y = worst((quality_x, quality_y))
    position_um = axes.weights @ axes.values_um
    of_x, of_y = (
        Budget(float(value), axes.lines(weights))
        for weights, value in zip(axes.weights, position_um, strict=True)
    )
    radius_um = math.hypot(of_x.value, of_y.value)
    angle_rad = math.atan2(of_y.value, of_x.value)
    outward = np.array([math.cos(angle_rad), math.sin(angle_rad)])
    quality, growth = worst((x.quality, y.quality)), axes.growth_budget()
    stated = {"shaft_centre_x_um": (of_x, quality_x), "shaft_centre_y_um": (of_y, quality_y)}
    if growth is not None:
        stated["gap_growth_um"] = (growth, axes.growth_quality)
    ratio_lines = axes.lines(outward @ axes.weights / clearance_um)
    of_clearance = systematic_line(CLEARANCE, accuracy.clearance, radius_um / clearance_um)
    of_ratio = Budget(radius_um / clearance_um, (*ratio_lines, of_clearance))
    of_angle = _angle(axes, outward, radius_um, math.degrees(angle_rad))
    stated |= {"eccentricity_ratio": (of_ratio, quality), "attitude_angle_deg": (of_angle, quality)}
    readings = {"gap_growth_um": NOT_MEASURED} | {
        name: missing(found.reason) if found.level is Level.BAD else budget.reading(found)
        for name, (budget, found) in stated.items()
    }
    ratio = readings["eccentricity_ratio"]
    if ratio.interval_95 is not None:
        low, high = ratio.interval_95
        readings["eccentricity_ratio"] = replace(ratio, interval_95=(max(low, 0.0), high))
    known = (name for name in stated if readings[name].value is not None)
    return readings, {name: stated[name][0] for name in known}


def _angle(axes: ProbeAxes, outward: FloatArray, radius_um: float, angle_deg: float) -> Budget:
    """Return the budget of the attitude angle, from the tangential uncertainty of the position.

    Near the centre, the angle is unknown and has an uncertainty of ± 180°.
    """
    across = np.array([-outward[1], outward[0]]) @ axes.weights
    along_um = Budget(angle_deg, axes.lines(across)).combined
    if math.degrees(along_um) >= HALF_CIRCLE_DEG / math.sqrt(3.0) * radius_um:
        return Budget(angle_deg, (systematic_line("no direction", HALF_CIRCLE_DEG, 1.0),))
    return Budget(angle_deg, axes.lines(math.degrees(1.0) / radius_um * across))
