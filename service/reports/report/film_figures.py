"""Stiffness against condition, and the map of the baseline."""

import math

from core.units import NS_PER_S
from service.reports.comparison_part import CellPart, ComparisonPart
from service.reports.plots.plot import Plot
from service.reports.plots.scales import Scale, around
from service.reports.report.case import Case
from service.reports.report.columns import DAY_S, GN_PER_M, finite_of
from service.reports.report.figure import Figure

EccentricityStiffness = tuple[list[float | None], list[float | None]]
"""Two columns."""

LOOKS = {"none": "unknown", "borrowed": "borrowed", "own": "known"}
"""Of cells, by their support."""


def condition_figure(case: Case) -> Figure | None:
    """Stiffness against eccentricity: members of the cell, the last day, what is expected."""
    found = case.comparison
    if found is None:
        return None
    recent, members = _recent(case), found.members
    e = [*(members.eccentricity_ratio if members else ()), *recent[0], found.eccentricity_ratio]
    k = [*(members.stiffness_n_per_m if members else ()), *recent[1], found.stiffness_n_per_m]
    x, y = around(e, 0.25), around(k, 0.15)
    if x is None or y is None:
        return None
    plot = Plot(
        *(350.0, 148.0),
        *(Scale(*x), Scale(*y, divisor=GN_PER_M)),
        *("Eccentricity ratio, 1", f"Stiffness {case.direction}, GN/m"),
        *("Stiffness against condition", "condition"),
    )
    _draw_films(plot, found, recent, y)
    return Figure(
        plot,
        f"Grey: the {members.n_in_all if members else 0} readings of the cell (pink) that the"
        " baseline stands on. Dashed: expected at this oil temperature. Blue: the last 24 hours."
        " Red: the reading of the alarm; its bar holds 95 % of what chance does.",
    )


def map_figure(case: Case) -> Figure | None:
    """Which conditions the baseline knows, and how stiff the film was in each."""
    found = case.comparison
    if found is None or not found.map or found.bounds is None:
        return None
    own, cells = found.bounds[:2], [_bounds(found, each) for each in found.map]
    sides = [[edge for bounds in (own, *cells) for edge in bounds[axis]] for axis in (0, 1)]
    x, y = (Scale(min(edges), max(edges)) for edges in sides)
    plot = Plot(
        *(350.0, 148.0, x, y),
        *("Eccentricity ratio, 1", "Oil temperature, °C", "Map of the baseline", "map"),
    )
    known = [e.location_n_per_m for e in found.map if e.support != "none"] or [1.0]
    low, high = min(known), max(known)
    for each, bounds in zip(found.map, cells, strict=True):
        plot.cell(bounds[0], bounds[1], LOOKS[each.support], _darkness(each, low, high))
    plot.cell(own[0], own[1], "own", 0.0)
    plot.points([found.eccentricity_ratio], [found.oil_temperature_c], "alarm", 2.2)
    return Figure(
        plot,
        f"What the baseline knows: the darker, the stiffer, {low / GN_PER_M:.3g} to"
        f" {high / GN_PER_M:.3g} GN/m. Dashed: known from neighbours. White: too few readings to"
        " compare. Red: the cell and reading of the alarm.",
    )


def _draw_films(
    plot: Plot, found: ComparisonPart, recent: EccentricityStiffness, height: tuple[float, float]
) -> None:
    members, expected = found.members, found.expected
    if found.bounds:
        plot.cell(found.bounds[0], height, "strip")
    if members is not None:
        plot.dots(members.eccentricity_ratio, members.stiffness_n_per_m, "member")
    if expected is not None:
        plot.line(expected.eccentricity_ratio, expected.stiffness_n_per_m, "expected")
    plot.dots(*recent, "today")
    _own_point(plot, found)


def _bounds(found: ComparisonPart, cell: CellPart) -> list[tuple[float, float]]:
    """Limits of a cell, all of which are as wide as that of the alarm."""
    widths = [high - low for low, high in (found.bounds or ())[:2]]
    return [(i * w, (i + 1) * w) for i, w in zip(cell.cell, widths, strict=False)]


def _darkness(cell: CellPart, low: float, high: float) -> float:
    if cell.support == "none" or high == low:
        return 1.0 if cell.support == "none" else 0.5
    return 0.12 + 0.78 * math.log(cell.location_n_per_m / low) / math.log(high / low)


def _own_point(plot: Plot, found: ComparisonPart) -> None:
    k, u = found.stiffness_n_per_m, found.u_random
    error = None if k is None or u is None else 1.96 * u * k
    plot.points([found.eccentricity_ratio], [k], "alarm", 2.4, [error])


def _recent(case: Case) -> EccentricityStiffness:
    """Eccentricity and stiffness of the settled readings of the last day before the alarm."""
    table = case.before
    since_ns = case.evidence.alarm.time_ns - DAY_S * NS_PER_S
    times, settled = table.get("time_ns", ()), table.get("is_settled", ())
    rows = [i for i, (t, s) in enumerate(zip(times, settled, strict=True)) if s and t >= since_ns]
    if not rows:
        return [], []
    e = finite_of(table["eccentricity_ratio"])
    k = finite_of(table[f"stiffness_n_per_m_{case.direction}"])
    return [e[i] for i in rows], [k[i] for i in rows]
