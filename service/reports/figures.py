"""Figures of a report: trend, condition, baseline map, spectra and orbit."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape

from core.baseline.history import are_ratios
from core.quality import Reason
from core.units import NS_PER_S
from service.reports.case import Case
from service.reports.parts import CellPart, ComparisonPart
from service.reports.plots import Plot, Scale, TimeScale, Values, around
from service.reports.tables import Columns


@dataclass(frozen=True)
class Figure:
    """Figure of a report: a plot and its caption, the text ``sentence``."""

    plot: Plot
    sentence: str

    @property
    def html(self) -> str:
        """HTML of the figure; its width is relative to the plot's, for equal font sizes."""
        caption = f"<figcaption>{escape(self.sentence)}</figcaption>"
        return f'<figure style="flex:{self.plot.width:g}">{self.plot.svg()}{caption}</figure>'


def _spectra_figure(case: Case) -> Figure | None:
    """Return the figure of the spectra of shaft and bearing in the direction of the alarm.

    None without a bearing, with fewer than three lines, or if all amplitudes are zero.
    """
    bearing, axis = case.bearing, case.direction
    rows = _rows(case.spectra, case.evidence.bearing)
    if bearing is None or len(rows) < 3:
        return None
    f, shaft, frame = (
        [case.spectra[name][i] for i in rows]
        for name in ("frequency_hz", f"shaft_{axis}_um_pk", f"bearing_{axis}_um_pk")
    )
    heights = _decades([*shaft, *frame])
    if heights is None:
        return None
    plot = Plot(
        *(525.0, 146.0),
        *(Scale(0.0, f[-1]), heights),
        *("Frequency, Hz", f"Amplitude {axis}, µm 0-pk", "Spectra", "spectra"),
    )
    lines = (("order1_frequency_hz", "1×"), ("vortex_frequency_hz", "vortex"))
    for row, (name, words) in enumerate(lines):
        reading = bearing.readings.get(name)
        if reading and reading.reason != Reason.OUTSIDE_BAND and reading.value is not None:
            plot.upright(reading.value, "marked", words, row)
    plot.line(f, shaft, "shaft")
    plot.line(f, frame, "bearing")
    return Figure(
        plot,
        f"Averaged spectra in {axis} as displacement, {bearing.window.n_segments} segments in"
        f" {bearing.window.duration_s:.0f} s before the alarm. Blue: shaft relative to bearing."
        " Orange: bearing.",
    )


def _decades(amplitudes: Sequence[float]) -> Scale | None:
    """Return a logarithmic scale of up to five decades for amplitudes; None if all are zero."""
    seen = [value for value in amplitudes if value and value > 0.0]
    if not seen:
        return None
    top = max(seen)
    floor = max(min(seen), top * 1e-5)
    low, high = math.floor(math.log10(floor)), math.ceil(math.log10(top))
    return Scale(10.0**low, 10.0 ** max(high, low + 1), True)


def _orbit_figure(case: Case) -> Figure | None:
    """Return the figure of the newest shaft orbits; None with fewer than two samples."""
    rows = _rows(case.orbits, case.evidence.bearing)
    if len(rows) < 2:
        return None
    x, y = ([case.orbits[name][i] for i in rows] for name in ("shaft_x_um", "shaft_y_um"))
    most = 1.1 * max(abs(value) for value in (*x, *y)) or 1.0
    plot = Plot(
        *(170.0, 146.0),
        Scale(-most, most),
        Scale(-most, most),
        *("Shaft x, µm", "Shaft y, µm", "Orbit", "orbit"),
    )
    plot.line(x, y, "shaft", math.inf)
    return Figure(plot, "The newest turns of the shaft in its bearing, means removed.")


def _rows(table: Columns, bearing: str | None) -> list[int]:
    return [i for i, each in enumerate(table.get("bearing", ())) if each == bearing]


GN_PER_M = 1e9


def _stiffness_scale(values: Values) -> tuple[str, float]:
    """Return the unit in which stiffnesses are drawn, and its size in N/m.

    The unit is GN/m; or k_b, of size 1, if stiffnesses are ratios to the bracket stiffness.
    """
    largest = max((abs(v) for v in values if v), default=GN_PER_M)
    return ("k_b", 1.0) if are_ratios(math.log(largest)) else ("GN/m", GN_PER_M)


DAY_S = 86_400.0


def _finite_of(values: Values) -> list[float | None]:
    """Return a list of numbers with NaN and infinity replaced by None."""
    return [v if v is not None and math.isfinite(v) else None for v in values]


LOOKS = {"none": "unknown", "borrowed": "borrowed", "own": "known"}
"""CSS classes of cells by support."""


def _condition_figure(case: Case) -> Figure | None:
    """Return the figure of stiffness against eccentricity; None without a comparison or numbers."""
    found = case.comparison
    if found is None:
        return None
    recent, members = _recent(case), found.members
    e = [*(members.eccentricity_ratio if members else ()), *recent[0], found.eccentricity_ratio]
    k = [*(members.stiffness if members else ()), *recent[1], found.stiffness]
    x, y = around(e, 0.25), around(k, 0.15)
    if x is None or y is None:
        return None
    unit, size = _stiffness_scale(k)
    plot = Plot(
        *(350.0, 148.0),
        *(Scale(*x), Scale(*y, divisor=size)),
        *("Eccentricity ratio, 1", f"Stiffness {case.direction}, {unit}"),
        *("Stiffness against condition", "condition"),
    )
    expected = found.expected
    if found.bounds:
        plot.cell(found.bounds[0], y, "strip")
    if members is not None:
        plot.dots(members.eccentricity_ratio, members.stiffness, "member")
    if expected is not None:
        plot.line(expected.eccentricity_ratio, expected.stiffness, "expected")
    plot.dots(*recent, "today")
    k_alarm, u = found.stiffness, found.u_random
    error = None if k_alarm is None or u is None else 1.96 * u * k_alarm
    plot.points([found.eccentricity_ratio], [k_alarm], "alarm", 2.4, [error])
    return Figure(
        plot,
        f"Grey: the {members.n_in_all if members else 0} readings of the cell (pink) of the"
        " baseline. Dashed: expected at this oil temperature. Blue: the last 24 hours."
        " Red: the reading of the alarm with its 95 % interval of random errors.",
    )


def _map_figure(case: Case) -> Figure | None:
    """Return the map of the cells of the baseline, shaded by stiffness; None without a baseline."""
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
    known = [e.location for e in found.map if e.support != "none"] or [1.0]
    low, high = min(known), max(known)
    unit, size = _stiffness_scale(known)
    for each, bounds in zip(found.map, cells, strict=True):
        plot.cell(bounds[0], bounds[1], LOOKS[each.support], _darkness(each, low, high))
    plot.cell(own[0], own[1], "own", 0.0)
    plot.points([found.eccentricity_ratio], [found.oil_temperature_c], "alarm", 2.2)
    return Figure(
        plot,
        f"Stiffness of the baseline, darker if stiffer, {low / size:.3g} to"
        f" {high / size:.3g} {unit}. Dashed: from neighbours. White: too few readings to"
        " compare. Red: the cell and reading of the alarm.",
    )


def _bounds(found: ComparisonPart, cell: CellPart) -> list[tuple[float, float]]:
    """Return the limits of a cell along both axes; all cells have the widths of the alarm's."""
    widths = [high - low for low, high in (found.bounds or ())[:2]]
    return [(i * w, (i + 1) * w) for i, w in zip(cell.cell, widths, strict=False)]


def _darkness(cell: CellPart, low: float, high: float) -> float:
    if cell.support == "none" or high == low:
        return 1.0 if cell.support == "none" else 0.5
    return 0.12 + 0.78 * math.log(cell.location / low) / math.log(high / low)


def _recent(case: Case) -> tuple[list[float | None], list[float | None]]:
    """Return eccentricity and stiffness of the settled readings within a day before the alarm."""
    table = case.before
    since_ns = case.evidence.alarm.time_ns - DAY_S * NS_PER_S
    times, settled = table.get("time_ns", ()), table.get("is_settled", ())
    rows = [i for i, (t, s) in enumerate(zip(times, settled, strict=True)) if s and t >= since_ns]
    if not rows:
        return [], []
    e = _finite_of(table["eccentricity_ratio"])
    k = _finite_of(table[f"stiffness_{case.direction}"])
    return [e[i] for i in rows], [k[i] for i in rows]


HOLE_S = 6 * 3600.0
"""Maximum gap between readings, in seconds, that the expected stiffness is drawn across."""

SHORTEST_S, MARGIN = 3600.0, 0.04
"""Minimum time before the alarm, in s, and time after it as a fraction of the time before."""


def _trend_figure(case: Case) -> Figure | None:
    """Return the figure of stiffness against time, with its limits; None without stiffnesses."""
    found, axis = _trend(case), case.direction
    if found is None:
        return None
    own = None if case.comparison is None else case.comparison.stiffness
    room = around([own, *found.stiffness, *found.lows, *found.highs])
    if room is None:
        return None
    unit, size = _stiffness_scale([own, *found.stiffness])
    plot = Plot(
        *(720.0, 126.0),
        TimeScale(found.first_s, found.last_s),
        Scale(*room, divisor=size),
        *("Time, UTC", f"Stiffness {axis}, {unit}", "Stiffness over time", "trend"),
    )
    time, k, after = found.time, found.stiffness, found.after
    before = [s and not a for s, a in zip(found.is_settled, after, strict=True)]
    plot.band(time, found.lows, found.highs, "band", HOLE_S)
    plot.line(time, found.expected, "expected", HOLE_S)
    plot.dots(time, _where(k, [not settled for settled in found.is_settled]), "unsettled")
    plot.dots(time, _where(k, before), "today")
    plot.dots(time, _where(k, after), "alarm")
    plot.upright(found.alarm_s, "at")
    plot.points([found.alarm_s], [own], "alarm", 2.2)
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
    """Readings of a film around an alarm, by column; times in seconds since 1970 UTC."""

    alarm_s: float
    time: list[float]
    stiffness: list[float | None]
    expected: list[float | None]
    is_settled: list[bool]
    limit: float

    @property
    def lows(self) -> list[float | None]:
        return _times(self.expected, 1.0 - self.limit)

    @property
    def highs(self) -> list[float | None]:
        return _times(self.expected, 1.0 + self.limit)

    @property
    def first_s(self) -> float:
        return min(self.time[0], self.alarm_s - SHORTEST_S)

    @property
    def last_s(self) -> float:
        return max(self.time[-1], self.alarm_s + MARGIN * (self.alarm_s - self.first_s))

    @property
    def after(self) -> list[bool]:
        """Whether each reading is settled and later than the alarm."""
        rows = zip(self.is_settled, self.time, strict=True)
        return [settled and time > self.alarm_s for settled, time in rows]


def _trend(case: Case) -> _Trend | None:
    table = {name: [*old, *case.after.get(name, ())] for name, old in case.before.items()}
    if not table.get("time_ns"):
        return None
    stiffness = _finite_of(table[f"stiffness_{case.direction}"])
    deviation = table[f"deviation_{case.direction}"]
    return _Trend(
        alarm_s=case.evidence.alarm.time_ns / NS_PER_S,
        time=[time / NS_PER_S for time in table["time_ns"]],
        stiffness=stiffness,
        expected=[
            None if k is None or by is None else k * math.exp(-by)
            for k, by in zip(stiffness, deviation, strict=True)
        ],
        is_settled=[bool(each) for each in table["is_settled"]],
        limit=case.evidence.limits["films"]["change"]["alert_change"],
    )


def _times(values: Values, factor: float) -> list[float | None]:
    return [None if value is None else value * factor for value in values]


def _where(values: Values, wanted: list[bool]) -> list[float | None]:
    return [value if is_wanted else None for value, is_wanted in zip(values, wanted, strict=True)]


def figures(case: Case) -> Iterator[str]:
    """Yield the HTML of each row of figures; figures without data are omitted."""
    for row in (
        (_trend_figure,),
        (_condition_figure, _map_figure),
        (_spectra_figure, _orbit_figure),
    ):
        drawn = [figure.html for make in row if (figure := make(case)) is not None]
        if drawn:
            yield f'<div class="row">{"".join(drawn)}</div>'
