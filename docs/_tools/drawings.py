"""Draw the machine, the axes of a bearing and the signs of its transducers: `make drawings`.

The signs and the position of the shaft in the drawing are computed by padwatch itself, so the
drawing cannot contradict the program.
"""

import math
from pathlib import Path

from core.condition.probe_axes import ProbeAxis
from core.condition.shaft_centre import locate_shaft
from core.quality import Reading
from service.settings.channels import ChannelSettings, Transducer

PICTURES = Path(__file__).parents[1] / "pictures"

INK, SOFT, SHAFT, PROBE, MARK = "#1d2326", "#5c666b", "#c9d6e2", "#1d4a73", "#b5178a"
REFERENCE_UM = 2000.0
GAPS_UM = (1880.0, 1930.0)
"""Gaps of the probes on +x and +y in the drawing: the shaft is nearer to both than centred."""

CLEARANCE_UM = 250.0


def main() -> None:
    """Write both drawings into docs/pictures."""
    for name, drawing in drawings().items():
        (PICTURES / f"{name}.svg").write_text(drawing, encoding="utf-8")


def drawings() -> dict[str, str]:
    """Return the drawings as SVG, by name."""
    return {"machine": _machine(), "signs": _signs()}


def default_sign(transducer: Transducer) -> int:
    """Return the sign that a channel of a transducer has without `direction`."""
    volts = {"full_scale_v": 12.0, "ok_min_v": 1.0, "ok_max_v": 11.0}
    sensitivity = {
        Transducer.PROXIMITY_PROBE: (4.0, "V/mm"),
        Transducer.ACCELEROMETER: (100.0, "mV/g"),
    }
    value, unit = sensitivity[transducer]
    settings = {"sensitivity": value, "sensitivity_unit": unit, **volts}
    return ChannelSettings(id="a", transducer=transducer, **settings).sign


def shaft_position() -> tuple[float, float, float, float]:
    """Return x and y in µm, eccentricity ratio, and attitude angle in degrees, at `GAPS_UM`."""
    axes = (ProbeAxis(Reading(gap_um), REFERENCE_UM) for gap_um in GAPS_UM)
    readings = locate_shaft(*axes, CLEARANCE_UM)[0]
    names = ("shaft_centre_x_um", "shaft_centre_y_um", "eccentricity_ratio", "attitude_angle_deg")
    x, y, ratio, angle = (readings[name].value or 0.0 for name in names)
    return x, y, ratio, angle


def _signs() -> str:
    x_um, y_um, ratio, angle = shaft_position()
    scale, cx, cy = 0.3, 290.0, 300.0
    ring, journal = 175.0, 175.0 - scale * CLEARANCE_UM
    sx, sy = cx + scale * x_um, cy - scale * y_um  # y of the bearing is up, y of SVG is down
    probe, accelerometer = (
        f"direction = {default_sign(one):+d}".replace("-", "−").replace("+", "")
        for one in (Transducer.PROXIMITY_PROBE, Transducer.ACCELEROMETER)
    )
    turn = -math.radians(angle)
    arc_x, arc_y = cx + 60 * math.cos(turn), cy + 60 * math.sin(turn)
    gap_x, gap_y = GAPS_UM
    parts = [
        _circle(cx, cy, ring, "#f3eedd", INK, 3),
        _circle(sx, sy, journal, SHAFT, INK, 2),
        _line(cx - 230, cy, cx + 255, cy, SOFT, arrow=True),
        _line(cx, cy + 230, cx, cy - 255, SOFT, arrow=True),
        _text(cx + 262, cy + 5, "+x", size=17),
        _text(cx + 8, cy - 250, "+y", size=17),
        _line(cx, cy, sx, sy, MARK, width=3, arrow=True),
        _path(f"M {cx + 60} {cy} A 60 60 0 0 0 {arc_x:.1f} {arc_y:.1f}", MARK),
        _text(cx + 66, cy - 10, f"{angle:.0f}°", MARK),
        _turn_arrow(sx, sy, journal - 16),
        _text(cx + 10, cy + ring - 24, 'rotation = "x_to_y"', PROBE),
        *_probe(cx + ring - 26, cy, horizontal=True),
        *_probe(cx, cy - ring + 26, horizontal=False),
        _text(
            620,
            70,
            "Seen so that +y is 90° counterclockwise from +x; not to scale",
            size=15,
            bold=True,
        ),
        _text(620, 110, "Proximity probes shaft_x, shaft_y", PROBE, bold=True),
        _text(620, 132, "on the positive axes, looking at the shaft."),
        _text(620, 154, f"The shaft moves to +x: the gap shrinks, {probe} (default)."),
        _text(620, 176, f"Here: gaps {gap_x:.0f} and {gap_y:.0f} µm, gap_reference_um = 2000, so"),
        _text(620, 198, f"the shaft is at x = {x_um:+.0f} µm, y = {y_um:+.0f} µm."),
        _text(620, 232, "Attitude angle, eccentricity ratio", MARK, bold=True),
        _text(620, 254, f"from +x towards +y: {angle:.0f}°; distance from the centre over"),
        _text(620, 276, f"the clearance of {CLEARANCE_UM:.0f} µm: {ratio:.2f}."),
        _text(620, 310, "Bearing transducers bearing_x, bearing_y", SOFT, bold=True),
        _text(620, 332, "on the bracket, in the same axes."),
        _text(620, 354, f"The bracket moves to +x: the signal rises, {accelerometer} (default)."),
        _text(620, 388, "Rotation", PROBE, bold=True),
        _text(620, 410, 'An orbit in the sense of rotation is "forward".'),
        _text(620, 432, "Default: from x to y."),
        _text(620, 466, "A transducer that counts the other way", bold=True),
        _text(620, 488, "gives a negative film stiffness: set its direction to the other sign."),
        _block(cx + ring + 24, cy + 46, "bearing_x"),
        _block(cx + 52, cy - ring - 58, "bearing_y"),
    ]
    return _svg(1100, 570, "Axes, probes and signs of a guide bearing", parts)


def _machine() -> str:
    middle = 230.0
    levels = {"Upper guide bearing, UJB": 120, "Lower guide bearing, LJB": 330}
    levels["Turbine guide bearing, TJB"] = 520
    parts = [
        _rect(middle - 16, 60, 32, 530, SHAFT),
        _rect(middle - 130, 180, 260, 90, "#e9ecee"),
        _text(middle - 62, 230, "generator rotor"),
        _path(f"M {middle - 90} 570 L {middle + 90} 570 L {middle + 50} 640 L {middle - 50} 640 Z"),
        _text(middle - 45, 612, "turbine runner"),
        _text(420, 60, "What padwatch measures at each guide bearing", bold=True, size=15),
    ]
    for name, y in levels.items():
        for side in (-1, 1):
            edge = middle + side * 22
            parts += [
                _rect(min(edge, edge + side * 26), y - 18, 26, 36, "#9fb4c6"),
                _rect(min(edge + side * 26, edge + side * 150), y - 8, 124, 16, "#d3d3cf"),
            ]
        parts += [
            _rect(middle + 74, y - 24, 14, 14, PROBE),
            _rect(middle + 100, y - 24, 14, 14, SOFT),
            _text(420, y - 4, name, bold=True),
            _text(420, y + 17, "two proximity probes, two bracket transducers, oil temperature"),
        ]
    parts += [
        _text(420, 232, "unbalance and hydraulic forces move the shaft in all films at once"),
        _rect(420, 388, 14, 14, "#9fb4c6"),
        _text(442, 400, "pads with the oil film between them and the shaft: the stiffness wanted"),
        _rect(420, 412, 14, 14, "#d3d3cf"),
        _text(
            442, 424, "bracket: stiffness and mass from the plant file turn its motion into force"
        ),
        _rect(420, 436, 14, 14, PROBE),
        _text(442, 448, "proximity probe on the bracket: motion of the shaft relative to it"),
        _rect(420, 460, 14, 14, SOFT),
        _text(442, 472, "accelerometer or velocity transducer: absolute motion of the bracket"),
    ]
    return _svg(920, 670, "A hydrogenerator with its three guide bearings", parts)


def _probe(x: float, y: float, *, horizontal: bool) -> list[str]:
    if horizontal:
        return [_rect(x, y - 9, 52, 18, PROBE), _text(x + 4, y + 28, "shaft_x", PROBE)]
    return [_rect(x - 9, y - 52, 18, 52, PROBE), _text(x - 72, y - 34, "shaft_y", PROBE)]


def _block(x: float, y: float, words: str) -> str:
    return _rect(x, y, 18, 18, SOFT) + _text(x + 24, y + 14, words, SOFT)


def _turn_arrow(x: float, y: float, radius: float) -> str:
    first, last = math.radians(200.0), math.radians(310.0)  # against the clock, below the centre
    start = f"{x + radius * math.cos(first):.1f} {y - radius * math.sin(first):.1f}"
    end = f"{x + radius * math.cos(last):.1f} {y - radius * math.sin(last):.1f}"
    return _path(f"M {start} A {radius:.1f} {radius:.1f} 0 0 0 {end}", PROBE, arrow=True)


def _circle(x: float, y: float, radius: float, fill: str, stroke: str, width: float) -> str:
    place = f'cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}"'
    return f'<circle {place} fill="{fill}" stroke="{stroke}" stroke-width="{width:g}"/>'


def _rect(x: float, y: float, width: float, height: float, fill: str) -> str:
    size = f'width="{width:g}" height="{height:g}"'
    return f'<rect x="{x:.1f}" y="{y:.1f}" {size} fill="{fill}" stroke="{INK}"/>'


def _line(
    x0: float, y0: float, x1: float, y1: float, colour: str, width: float = 1.5, *, arrow: bool
) -> str:
    return _path(f"M {x0:.1f} {y0:.1f} L {x1:.1f} {y1:.1f}", colour, width, arrow=arrow)


def _path(data: str, colour: str = INK, width: float = 2.0, *, arrow: bool = False) -> str:
    head = ' marker-end="url(#head)"' if arrow else ""
    return f'<path d="{data}" fill="none" stroke="{colour}" stroke-width="{width:g}"{head}/>'


def _text(
    x: float, y: float, words: str, colour: str = INK, *, size: int = 14, bold: bool = False
) -> str:
    weight = ' font-weight="600"' if bold else ""
    written = words.replace("&", "&amp;").replace('"', "&quot;")
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}" font-size="{size}"{weight}>{written}</text>'
    )


def _svg(width: int, height: int, title: str, parts: list[str]) -> str:
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}"'
        f' font-family="system-ui, sans-serif" role="img"><title>{title}</title>'
    )
    marker = (
        '<defs><marker id="head" viewBox="0 0 10 10" refX="8" refY="5" markerWidth="7"'
        ' markerHeight="7" orient="auto"><path d="M 0 0 L 10 5 L 0 10 z" fill="context-stroke"/>'
        "</marker></defs>"
    )
    ground = f'<rect width="{width}" height="{height}" fill="#ffffff"/>'
    return "\n".join([head, marker, ground, *parts, "</svg>"]) + "\n"


if __name__ == "__main__":
    main()
