"""Stiffness against condition, and the map of the baseline."""

import math

from core.units import NS_PER_S
from service.evidence.comparison_part import ComparisonPart
from service.evidence.plots.plot import Plot
from service.evidence.plots.scales import Scale, around
from service.evidence.report.case import Case
from service.evidence.report.columns import DAY_S, GN_PER_M, finite_of
from service.evidence.report.figure import Figure


def condition_figure(case: Case) -> Figure | None:
    """Stiffness against eccentricity: members of the cell, the last day, what is expected."""
    found = case.comparison
    if found is None:
        return None
    recent = _recent(case)
    members, expected = found.members, found.expected
    e = [*(members.eccentricity_ratio if members else ()), *recent[0], found.eccentricity_ratio]
    k = [*(members.stiffness_n_per_m if members else ()), *recent[1], found.stiffness_n_per_m]
    x, y = around(e, 0.25), around(k, 0.15)
    if x is None or y is None:
        return None
    plot = Plot(
        *(350.0, 148.0),
        Scale(*x),
        Scale(*y, divisor=GN_PER_M),
        *("Eccentricity ratio, 1", f"Stiffness {case.direction}, GN/m"),
        *("Stiffness against condition", "condition"),
    )
    if found.bounds:
        plot.cell(found.bounds[0], (y[0], y[1]), "strip")
    if members is not None:
        plot.dots(members.eccentricity_ratio, members.stiffness_n_per_m, "member")
    if expected is not None:
        plot.line(expected.eccentricity_ratio, expected.stiffness_n_per_m, "expected")
    plot.dots(recent[0], recent[1], "today")
    _own_point(plot, found)
    n = members.n_in_all if members else 0
    return Figure(
        plot,
        f"Grey: the {n} readings of the cell (pink) that the baseline stands on. Dashed: expected"
        " at this oil temperature. Blue: the last 24 hours. Red: the reading of the alarm; its bar"
        " holds 95 % of what chance does.",
    )


def map_figure(case: Case) -> Figure | None:
    """Which conditions the baseline knows, and how stiff the film was in each."""
    found = case.comparison
    if found is None or not found.map or found.bounds is None:
        return None
    (e0, e1), (t0, t1) = found.bounds[:2]
    width_e, width_t = e1 - e0, t1 - t0
    columns = {each.cell[0] for each in found.map} | {round(e0 / width_e)}
    rows = {each.cell[1] for each in found.map} | {round(t0 / width_t)}
    plot = Plot(
        *(350.0, 148.0),
        Scale(min(columns) * width_e, (max(columns) + 1) * width_e),
        Scale(min(rows) * width_t, (max(rows) + 1) * width_t),
        *("Eccentricity ratio, 1", "Oil temperature, °C", "Map of the baseline", "map"),
    )
    logs = [math.log(each.location_n_per_m) for each in found.map if each.support != "none"]
    low, high = min(logs, default=0.0), max(logs, default=1.0)
    for each in found.map:
        e, t = each.cell[0] * width_e, each.cell[1] * width_t
        share = (math.log(each.location_n_per_m) - low) / ((high - low) or 1.0)
        look = {"none": "unknown", "borrowed": "borrowed", "own": "known"}[each.support]
        opacity = 0.12 + 0.78 * min(1.0, max(0.0, share)) if each.support != "none" else 1.0
        plot.cell((e, e + width_e), (t, t + width_t), look, opacity)
    plot.cell((e0, e1), (t0, t1), "own", 0.0)
    plot.points([found.eccentricity_ratio], [found.oil_temperature_c], "alarm", 2.2)
    return Figure(
        plot,
        f"What the baseline knows: the darker, the stiffer, {math.exp(low) / GN_PER_M:.3g} to"
        f" {math.exp(high) / GN_PER_M:.3g} GN/m. Dashed: known from neighbours. White: too few"
        " readings to compare. Red: the cell and reading of the alarm.",
    )


def _own_point(plot: Plot, found: ComparisonPart) -> None:
    k, u = found.stiffness_n_per_m, found.u_random
    error = None if k is None or u is None else 1.96 * u * k
    plot.points([found.eccentricity_ratio], [k], "alarm", 2.4, [error])


def _recent(case: Case) -> tuple[list[float | None], list[float | None]]:
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
