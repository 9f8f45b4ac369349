"""Stiffness over time, before and after the alarm."""

import math
from dataclasses import dataclass

from core.units import NS_PER_S
from service.reports.plots.plot import Plot, Values
from service.reports.plots.scales import Scale, TimeScale, around
from service.reports.report.case import Case
from service.reports.report.columns import DAY_S, GN_PER_M, finite_of
from service.reports.report.figure import Figure
from service.reports.tables import Columns

HOLE_S = 6 * 3600.0
"""Expected stiffness is not drawn across longer holes."""

SHORTEST_S, MARGIN = 3600.0, 0.04
"""Before the alarm at least, and after it as a share of what is before."""


def trend_figure(case: Case) -> Figure | None:
    """Stiffness before and after, with what is expected and the limit."""
    found = _trend(case)
    room = None if found is None else around(_heights(case, found))
    if found is None or room is None:
        return None
    axis = case.direction
    plot = Plot(
        *(720.0, 126.0),
        TimeScale(found.first_s, found.last_s),
        Scale(*room, divisor=GN_PER_M),
        *("Time, UTC", f"Stiffness {axis}, GN/m", "Stiffness over time", "trend"),
    )
    _draw(plot, found)
    if case.comparison is not None:
        plot.points([found.alarm_s], [case.comparison.stiffness_n_per_m], "alarm", 2.2)
    days = (found.last_s - found.first_s) / DAY_S
    return Figure(
        plot,
        f"Stiffness of the film in {axis} over {days:.0f} days, {len(found.time)} readings; red"
        f" line: the alarm with its reading, red dots: {sum(found.after)} readings since. Dashed:"
        f" expected under the condition of each reading; band: within {100.0 * found.limit:g} % of"
        " it, the limit of an alert. Light grey: not settled.",
    )


@dataclass(frozen=True)
class _Trend:
    """Readings of a film around an alarm, by column; times in seconds since 1970."""

    alarm_s: float
    time: list[float]
    stiffness: list[float | None]
    expected: list[float | None]
    is_settled: list[bool]
    limit: float

    @property
    def lows(self) -> list[float | None]:
        return _times(self.expected, math.exp(-self.limit))

    @property
    def highs(self) -> list[float | None]:
        return _times(self.expected, math.exp(self.limit))

    @property
    def first_s(self) -> float:
        return min(self.time[0], self.alarm_s - SHORTEST_S)

    @property
    def last_s(self) -> float:
        return max(self.time[-1], self.alarm_s + MARGIN * (self.alarm_s - self.first_s))

    @property
    def after(self) -> list[bool]:
        """Whether each reading is settled, and later than the alarm."""
        rows = zip(self.is_settled, self.time, strict=True)
        return [settled and time > self.alarm_s for settled, time in rows]


def _trend(case: Case) -> _Trend | None:
    table, axis = _joined(case.before, case.after), case.direction
    if not table.get("time_ns"):
        return None
    stiffness = finite_of(table[f"stiffness_n_per_m_{axis}"])
    return _Trend(
        alarm_s=case.evidence.alarm.time_ns / NS_PER_S,
        time=[time / NS_PER_S for time in table["time_ns"]],
        stiffness=stiffness,
        expected=_expected(stiffness, table[f"deviation_{axis}"]),
        is_settled=[bool(each) for each in table["is_settled"]],
        limit=case.evidence.limits["films"]["change"]["alert_change"],
    )


def _draw(plot: Plot, found: _Trend) -> None:
    time, k, after = found.time, found.stiffness, found.after
    before = [s and not a for s, a in zip(found.is_settled, after, strict=True)]
    plot.band(time, found.lows, found.highs, "band", HOLE_S)
    plot.line(time, found.expected, "expected", HOLE_S)
    plot.dots(time, _where(k, [not settled for settled in found.is_settled]), "unsettled")
    plot.dots(time, _where(k, before), "today")
    plot.dots(time, _where(k, after), "alarm")
    plot.upright(found.alarm_s, "at")


def _heights(case: Case, found: _Trend) -> list[float | None]:
    own = None if case.comparison is None else case.comparison.stiffness_n_per_m
    return [own, *found.stiffness, *found.lows, *found.highs]


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
