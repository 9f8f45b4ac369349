"""Draw axes, probes and signs of a guide bearing: `python docs/_tools/axes.py`."""

from math import cos, radians, sin
from pathlib import Path

PICTURE = Path(__file__).parents[1] / "pictures" / "axes.svg"

CENTRE, CLEARANCE, SHAFT = (230.0, 210.0), 120.0, 84.0
ECCENTRICITY, ATTITUDE_DEG = 20.0, 35.0

STYLE = """
  text { font: 14px sans-serif; fill: #1d2326; }
  .soft { fill: #4c565b; font-size: 12px; }
  .line { stroke: #1d2326; stroke-width: 1.6; fill: none; }
  .thin { stroke: #6b7479; stroke-width: 1; fill: none; stroke-dasharray: 4 3; }
  .shaft { fill: #d5dbdf; stroke: #1d2326; stroke-width: 1.6; }
  .probe { fill: #1d4a73; } .pickup { fill: #8a5a13; }
"""


def at(length: float, degrees: float) -> tuple[float, float]:
    """Point at a distance and an angle from the centre of the bearing; y points up."""
    x, y = CENTRE
    return x + length * cos(radians(degrees)), y - length * sin(radians(degrees))


def text(place: tuple[float, float], words: str, kind: str = "") -> str:
    """Words of the drawing."""
    return f'<text x="{place[0]:.0f}" y="{place[1]:.0f}" class="{kind}">{words}</text>'


def line(start: tuple[float, float], end: tuple[float, float], kind: str, head: str = "") -> str:
    """Straight line, with an arrow head if one is given."""
    ends = f'x1="{start[0]:.1f}" y1="{start[1]:.1f}" x2="{end[0]:.1f}" y2="{end[1]:.1f}"'
    return f'<line {ends} class="{kind}"{head}/>'


def circle(place: tuple[float, float], radius: float, kind: str) -> str:
    """Circle of a class of the style."""
    return f'<circle cx="{place[0]:.1f}" cy="{place[1]:.1f}" r="{radius:.0f}" class="{kind}"/>'


def box(degrees: float, start: float, length: float, kind: str) -> str:
    """Transducer along a radius of the bearing."""
    (x, y), turned = at(start, degrees), -degrees
    place = f'x="{x:.0f}" y="{y - 7:.0f}" width="{length:.0f}" height="14"'
    return f'<rect {place} class="{kind}" transform="rotate({turned:.0f} {x:.0f} {y:.0f})"/>'


def drawing() -> str:
    """SVG of a bearing seen from above."""
    arrow = ' marker-end="url(#arrow)"'
    shaft = at(ECCENTRICITY, ATTITUDE_DEG)
    turn = f"M{at(52, -70)[0]:.0f} {at(52, -70)[1]:.0f}A52 52 0 0 0 {at(52, 20)[0]:.0f} "
    parts = [
        circle(CENTRE, CLEARANCE, "line"),
        circle(shaft, SHAFT, "shaft"),
        line(at(-150, 0), at(180, 0), "thin", arrow),
        line(at(-150, 90), at(185, 90), "thin", arrow),
        line(CENTRE, shaft, "line"),
        circle(shaft, 3, "probe"),
        f'<path d="{turn}{at(52, 20)[1]:.0f}" class="line"{arrow}/>',
        *(box(angle, CLEARANCE - 6, 46, "probe") for angle in (0, 90)),
        *(box(angle, CLEARANCE + 8, 34, "pickup") for angle in (180, 270)),
        text(at(184, -2), "+x"),
        text(at(190, 88), "+y"),
        text((252, 282), "rotation x to y", "soft"),
        text((252, 196), "e", "soft"),
        text((CENTRE[0] + 120, 180), "shaft_x", "soft"),
        text((CENTRE[0] + 12, 62), "shaft_y", "soft"),
        text((24, 190), "bearing_x", "soft"),
        text((CENTRE[0] + 12, 372), "bearing_y", "soft"),
        text((455, 70), "Proximity probe on the positive side (blue):"),
        text((455, 90), "the gap shrinks as the shaft moves along + :"),
        text((455, 110), "direction = -1, the default of a probe."),
        text((455, 145), "Probe on the negative side, or a device that"),
        text((455, 165), "reports motion and not gap: direction = 1."),
        text((455, 200), "Pickup on the bearing (brown): reads motion"),
        text((455, 220), "along +x and +y: direction = 1, the default;"),
        text((455, 240), "-1 if it is mounted the other way round."),
        text((455, 275), "Attitude angle: from +x towards +y."),
        text((455, 295), "e: eccentricity; over the clearance, its ratio."),
    ]
    marker = (
        '<marker id="arrow" viewBox="0 0 10 10" refX="8" refY="5" markerWidth="7" markerHeight="7"'
        ' orient="auto"><path d="M0 0L10 5L0 10z" fill="#4c565b"/></marker>'
    )
    head = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 780 400" role="img"'
    title = "<title>Axes, probes and signs of a guide bearing, seen from above</title>"
    ground = '<rect width="780" height="400" fill="#fafaf8"/>'
    body = "\n".join([title, f"<style>{STYLE}</style>", f"<defs>{marker}</defs>", ground, *parts])
    return f"{head}>\n{body}\n</svg>\n"


if __name__ == "__main__":
    PICTURE.write_text(drawing(), encoding="utf-8")
