"""Shaft centre, eccentricity ratio and attitude angle in a bearing, from gaps."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from core.arrays import FloatArray
from core.condition.probe_axes import Growth, ProbeAxes, ProbeAxis
from core.machine.unit import GapAccuracy
from core.quality import Level, Quality, Reading, Reason, missing, worst
from core.uncertainty import Budget, systematic_line

CLEARANCE = "clearance"

HALF_CIRCLE_DEG = 180.0
"""Half-width of an unknown angle."""


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
        Widening of all gaps since their references were read; measured by opposite probes only.
    budgets
        Of position and eccentricity ratio, under the names of the fields.
    """

    x_um: Reading
    y_um: Reading
    eccentricity_ratio: Reading
    attitude_angle_deg: Reading
    gap_growth_um: Reading
    budgets: Mapping[str, Budget] = field(default_factory=dict)


def locate_shaft(
    x: ProbeAxis,
    y: ProbeAxis,
    clearance_um: float,
    accuracy: GapAccuracy | None = None,
    last_growth: Growth | None = None,
) -> ShaftCentre:
    """Locate the shaft from one or two probes on each axis, with uncertainty.

    An axis with one probe cannot separate the shaft's displacement from thermal growth. It takes
    the growth that the other axis measures now, else `last_growth`, else none, with the
    corresponding uncertainty.

    Parameters
    ----------
    clearance_um
        Radial clearance; must be positive.
    accuracy
        Limits of error; by default those of :class:`GapAccuracy`.
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
    of_x, of_y = (
        Budget(float(value), axes.lines(weights))
        for weights, value in zip(axes.weights, position_um, strict=True)
    )
    x_um, y_um = _reading(of_x, x.quality), _reading(of_y, y.quality)
    quality, growth_um = worst((x.quality, y.quality)), missing(Reason.NOT_MEASURED)
    budgets = {"x_um": of_x, "y_um": of_y}
    of_growth = axes.growth_budget()
    if of_growth is not None:
        budgets["gap_growth_um"] = of_growth
        growth_um = _reading(of_growth, axes.growth_quality)
    if x_um.value is None or y_um.value is None:
        nowhere = missing(quality.reason)
        return ShaftCentre(x_um, y_um, nowhere, nowhere, growth_um, budgets)
    radius_um = math.hypot(x_um.value, y_um.value)
    angle_rad = math.atan2(y_um.value, x_um.value)
    outward = np.array([math.cos(angle_rad), math.sin(angle_rad)])
    of_ratio = _eccentricity(axes, outward, radius_um, clearance_um, accuracy)
    of_angle = _angle(axes, outward, radius_um, math.degrees(angle_rad))
    return ShaftCentre(
        x_um,
        y_um,
        _not_below_zero(_reading(of_ratio, quality)),
        _reading(of_angle, quality),
        growth_um,
        budgets | {"eccentricity_ratio": of_ratio, "attitude_angle_deg": of_angle},
    )


def _eccentricity(
    axes: ProbeAxes,
    outward: FloatArray,
    radius_um: float,
    clearance_um: float,
    accuracy: GapAccuracy,
) -> Budget:
    ratio = radius_um / clearance_um
    lines = axes.lines(outward @ axes.weights / clearance_um)
    return Budget(ratio, (*lines, systematic_line(CLEARANCE, accuracy.clearance, ratio)))


def _not_below_zero(reading: Reading) -> Reading:
    low, high = reading.interval_95 or (0.0, 0.0)
    return replace(reading, interval_95=(max(low, 0.0), high))


def _angle(axes: ProbeAxes, outward: FloatArray, radius_um: float, angle_deg: float) -> Budget:
    """Angle with the uncertainty of the motion across it; unknown near the centre."""
    across = np.array([-outward[1], outward[0]]) @ axes.weights
    along_um = Budget(angle_deg, axes.lines(across)).combined
    if math.degrees(along_um) >= HALF_CIRCLE_DEG / math.sqrt(3.0) * radius_um:
        return Budget(angle_deg, (systematic_line("no direction", HALF_CIRCLE_DEG, 1.0),))
    return Budget(angle_deg, axes.lines(math.degrees(1.0) / radius_um * across))


def _reading(budget: Budget, quality: Quality) -> Reading:
    if quality.level is Level.BAD:
        return missing(quality.reason)
    return Reading(budget.value, quality, budget.random, budget.systematic, budget.interval)
