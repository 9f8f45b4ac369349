"""Plots in SVG: scales, axes, lines, points and areas."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from html import escape

Tick = tuple[float, str]
"""Value and label of a tick of an axis."""

STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)

TIME_STEPS_H = (0.25, 0.5, 1, 2, 3, 6, 12, 24, 48, 96, 168, 336, 720, 2160, 8760)


@dataclass(frozen=True)
class Scale:
    """Linear or logarithmic scale of an axis from `low` to `high`.

    Parameters
    ----------
    divisor
        Divisor of values in tick labels; 1e9 shows N/m as GN/m.
    """

    low: float
    high: float
    is_log: bool = False
    divisor: float = 1.0

    def at(self, value: float) -> float:
        """Return the position of a value on the axis: 0 at `low`, 1 at `high`, or beyond."""
        if self.is_log:
            value = max(value, 1e-300)
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)

    def ticks(self, most: int = 6) -> Sequence[Tick]:
        """Return about `most` ticks at round values, or on a log scale all powers of ten."""
        return self._decades() if self.is_log else self._linear(most)

    def _linear(self, most: int) -> list[Tick]:
        low, high = self.low / self.divisor, self.high / self.divisor
        power = 10.0 ** math.floor(math.log10((high - low) / most))
        step = next(s * power for s in STEPS if (high - low) / (s * power) <= most)
        first = math.ceil(low / step - 1e-9)
        values = [i * step for i in range(first, math.floor(high / step + 1e-9) + 1)]
        return [(value * self.divisor, f"{value:.10g}") for value in values]

    def _decades(self) -> list[Tick]:
        first, last = math.ceil(math.log10(self.low)), math.floor(math.log10(self.high))
        return [(10.0**n, f"{10.0**n:g}") for n in range(first, last + 1)]


@dataclass(frozen=True)
class TimeScale(Scale):
    """Linear scale of a time axis, in seconds since 1970 UTC."""

    def ticks(self, most: int = 8) -> Sequence[Tick]:
        """Return about `most` ticks at round hours or days of UTC."""
        span_h = (self.high - self.low) / 3600.0
        step_s = 3600.0 * next((s for s in TIME_STEPS_H if span_h / s <= most), TIME_STEPS_H[-1])
        first = math.ceil(self.low / step_s)
        times = [i * step_s for i in range(first, math.floor(self.high / step_s) + 1)]
        pattern = "%d %b" if step_s >= 86_400.0 else "%d %b %H:%M"
        return [(t, datetime.fromtimestamp(t, UTC).strftime(pattern)) for t in times]


def around(values: Iterable[float | None], margin: float = 0.06) -> tuple[float, float] | None:
    """Return the range (low, high) of finite values, wider by the share `margin` at both ends.

    A range of zero width is widened by 5 % of its value. None if no value is finite.
    """
    found = [value for value in values if value is not None and math.isfinite(value)]
    if not found:
        return None
    low, high = min(found), max(found)
    room = margin * (high - low) or 0.05 * abs(high) or 1.0
    return low - room, high + room


LEFT, RIGHT, TOP, BOTTOM = 46.0, 8.0, 6.0, 30.0

TIME_ROOM, NUMBER_ROOM = 62.0, 40.0
"""Width reserved for a tick label of a time axis and of a number axis, in SVG user units."""

Values = Sequence[float | None]
"""Sequence of numbers; None for missing numbers."""


@dataclass
class Plot:
    """Plot in SVG, built from marks; the argument `look` of a method is the CSS class of a mark.

    Parameters
    ----------
    width, height
        Size in SVG user units; the font size is 9 units.
    x, y
        Scales of the axes.
    x_label, y_label
        Labels of the axes, with units.
    title
        Text alternative of the plot.
    name
        Identifier of the plot, unique in the page.
    """

    width: float
    height: float
    x: Scale
    y: Scale
    x_label: str
    y_label: str
    title: str
    name: str
    _marks: list[str] = field(default_factory=list)

    def line(self, xs: Values, ys: Values, look: str, longest_step: float = math.inf) -> None:
        """Add a line, interrupted at missing numbers and at steps along x over `longest_step`."""
        path, last = [], None
        for x, y in zip(xs, ys, strict=True):
            if x is None or y is None:
                last = None
                continue
            begins = last is None or x - last > longest_step
            path.append(f"{'M' if begins else 'L'}{self._x(x)} {self._y(y)}")
            last = x
        if path:
            self._marks.append(f'<path class="{look}" d="{"".join(path)}"/>')

    def band(self, xs: Values, lows: Values, highs: Values, look: str, longest_step: float) -> None:
        """Add the area between two lines.

        It is interrupted at missing numbers and at steps along x over `longest_step`.
        """
        piece: list[tuple[float, float, float]] = []
        for x, low, high in zip(xs, lows, highs, strict=True):
            if x is None or low is None or high is None:
                self._area(piece, look)
                piece = []
                continue
            if piece and x - piece[-1][0] > longest_step:
                self._area(piece, look)
                piece = []
            piece.append((x, low, high))
        self._area(piece, look)

    def points(
        self, xs: Values, ys: Values, look: str, radius: float = 1.6, errors: Values | None = None
    ) -> None:
        """Add points; `errors` are half-lengths of error bars along y, None without error bars."""
        for i, (x, y) in enumerate(zip(xs, ys, strict=True)):
            if x is None or y is None:
                continue
            error = None if errors is None else errors[i]
            if error is not None and error > 0.0:
                ends = f"M{self._x(x)} {self._y(y - error)}V{self._y(y + error)}"
                self._marks.append(f'<path class="{look} bar" d="{ends}"/>')
            self._marks.append(
                f'<circle class="{look}" cx="{self._x(x)}" cy="{self._y(y)}" r="{radius:g}"/>'
            )

    def dots(self, xs: Values, ys: Values, look: str) -> None:
        """Add points as a single SVG path, for large numbers of points."""
        found = (
            f"M{self._x(x)} {self._y(y)}h0"
            for x, y in zip(xs, ys, strict=True)
            if x is not None and y is not None
        )
        self._marks.append(f'<path class="{look} dots" d="{"".join(found)}"/>')

    def cell(
        self, x: tuple[float, float], y: tuple[float, float], look: str, opacity: float = 1.0
    ) -> None:
        """Add a rectangle, given by its limits along x and y, with an opacity of 0 to 1."""
        left, right, top, bottom = self._x(x[0]), self._x(x[1]), self._y(y[1]), self._y(y[0])
        self._marks.append(
            f'<path class="{look}" fill-opacity="{opacity:.2f}"'
            f' d="M{left} {top}H{right}V{bottom}H{left}Z"/>'
        )

    def upright(self, x: float, look: str, words: str = "", row: int = 0) -> None:
        """Add a vertical line at `x`, in units of the x axis, with the label `words`.

        `look` is the CSS class of the line, and `row` the row of the label, from 0 at the top.
        """
        place, y = self._x(x), TOP + 8 + 9 * row
        self._marks.append(f'<path class="{look}" d="M{place} {TOP:g}V{self.height - BOTTOM:g}"/>')
        self._marks.append(
            f'<text class="note" x="{place}" y="{y:g}" dx="2">{escape(words)}</text>'
        )

    def svg(self) -> str:
        """Return the plot as SVG."""
        size = f"0 0 {self.width:g} {self.height:g}"
        clip = f"inside-{self.name}"
        area = (
            f'<clipPath id="{clip}"><rect x="{LEFT:g}" y="{TOP:g}"'
            f' width="{self._right - LEFT:g}" height="{self.height - BOTTOM - TOP:g}"/></clipPath>'
        )
        return (
            f'<svg viewBox="{size}" role="img" aria-label="{escape(self.title)}">'
            f"{area}{self._axes()}"
            f'<g clip-path="url(#{clip})">{"".join(self._marks)}</g></svg>'
        )

    @property
    def _right(self) -> float:
        return self.width - RIGHT

    def _axes(self) -> str:
        bottom = self.height - BOTTOM
        parts = [f'<path class="frame" d="M{LEFT:g} {TOP:g}V{bottom:g}H{self._right:g}"/>']
        room = TIME_ROOM if isinstance(self.x, TimeScale) else NUMBER_ROOM
        most = max(2, int((self._right - LEFT) / room))
        for value, words in self.x.ticks(most):
            x = self._x(value)
            parts.append(f'<path class="grid" d="M{x} {TOP:g}V{bottom:g}"/>')
            parts.append(f'<text class="mid" x="{x}" y="{bottom + 11:g}">{escape(words)}</text>')
        for value, words in self.y.ticks(max(2, int((bottom - TOP) / 24))):
            y = self._y(value)
            parts.append(f'<path class="grid" d="M{LEFT:g} {y}H{self._right:g}"/>')
            parts.append(
                f'<text class="end" x="{LEFT - 4:g}" y="{y}" dy="3">{escape(words)}</text>'
            )
        middle_x, middle_y = (LEFT + self._right) / 2, (TOP + bottom) / 2
        label = escape(self.x_label)
        parts.append(f'<text class="mid" x="{middle_x:g}" y="{self.height - 5:g}">{label}</text>')
        parts.append(
            f'<text class="mid" transform="translate(10 {middle_y:g}) rotate(-90)">'
            f"{escape(self.y_label)}</text>"
        )
        return "".join(parts)

    def _area(self, piece: Sequence[tuple[float, float, float]], look: str) -> None:
        if not piece:
            return
        there = "L".join(f"{self._x(x)} {self._y(high)}" for x, _, high in piece)
        back = "L".join(f"{self._x(x)} {self._y(low)}" for x, low, _ in reversed(piece))
        self._marks.append(f'<path class="{look}" d="M{there}L{back}Z"/>')

    def _x(self, value: float) -> str:
        return f"{LEFT + self.x.at(value) * (self._right - LEFT):.1f}"

    def _y(self, value: float) -> str:
        bottom = self.height - BOTTOM
        return f"{bottom - self.y.at(value) * (bottom - TOP):.1f}"
