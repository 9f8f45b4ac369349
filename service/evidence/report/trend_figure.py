"""Stiffness over time, before and after the alarm."""

import math

from core.units import NS_PER_S
from service.evidence.plots.plot import Plot, Values
from service.evidence.plots.scales import Scale, TimeScale, around
from service.evidence.report.case import Case
from service.evidence.report.columns import DAY_S, GN_PER_M, finite_of
from service.evidence.report.figure import Figure
from service.evidence.tables import Columns

HOLE_S = 6 * 3600.0
"""Expected stiffness is not drawn across longer holes."""


def trend_figure(case: Case) -> Figure | None:
    """Stiffness before and after, with what is expected and the limit."""
    table, axis = _joined(case.before, case.after), case.direction
    if not table.get("time_ns"):
        return None
    time = [t / NS_PER_S for t in table["time_ns"]]
    k = finite_of(table[f"stiffness_n_per_m_{axis}"])
    expected = _expected(k, table[f"deviation_{axis}"])
    limit = case.evidence.limits["films"]["change"]["alert_change"]
    lows, highs = (_times(expected, math.exp(sign * limit)) for sign in (-1.0, 1.0))
    room = around([*k, *lows, *highs])
    if room is None:
        return None
    alarm_s = case.evidence.alarm.time_ns / NS_PER_S
    last = max(time[-1], alarm_s + 0.04 * (alarm_s - time[0]))
    plot = Plot(
        *(720.0, 126.0),
        TimeScale(time[0], last if last > time[0] else time[0] + 3600.0),
        Scale(*room, divisor=GN_PER_M),
        *("Time, UTC", f"Stiffness {axis}, GN/m", "Stiffness over time", "trend"),
    )
    plot.band(time, lows, highs, "band", HOLE_S)
    plot.line(time, expected, "expected", HOLE_S)
    settled = table["is_settled"]
    plot.dots(time, _where(k, [not each for each in settled]), "unsettled")
    before = [bool(s) and t <= alarm_s for s, t in zip(settled, time, strict=True)]
    after = [bool(s) and t > alarm_s for s, t in zip(settled, time, strict=True)]
    plot.dots(time, _where(k, before), "today")
    plot.dots(time, _where(k, after), "alarm")
    plot.upright(alarm_s, "at")
    n_after = sum(after)
    return Figure(
        plot,
        f"Stiffness of the film in {axis} over {(last - time[0]) / DAY_S:.0f} days, {len(time)}"
        f" readings; red line: the alarm, red dots: {n_after} readings since. Dashed: expected"
        f" under the condition of each reading; band: within {100.0 * limit:g} % of it, the limit"
        " of an alert. Light grey: not settled.",
    )


def _joined(before: Columns, after: Columns) -> Columns:
    return {name: [*column, *after.get(name, ())] for name, column in before.items()}


def _expected(k: Values, deviation: Values) -> list[float | None]:
    """What each reading was compared with."""
    return [
        None if value is None or by is None else value * math.exp(-by)
        for value, by in zip(k, deviation, strict=True)
    ]


def _times(values: Values, factor: float) -> list[float | None]:
    return [None if value is None else value * factor for value in values]


def _where(values: Values, wanted: list[bool]) -> list[float | None]:
    return [value if is_wanted else None for value, is_wanted in zip(values, wanted, strict=True)]
