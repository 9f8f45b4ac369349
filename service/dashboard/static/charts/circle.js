/** Plane charts with equal axes: the orbit, and the shaft centre in its clearance circle. */

import { formatFixed, formatTime } from "../format.js";
import { FAINT, INK, X_BAND, X_COLOUR, axis, baseLayout, curve, points } from "./style.js";

const MARGIN = 1.12;

function planeLayout(reachUm, revision, shapes = []) {
  const range = [-reachUm, reachUm];
  return baseLayout(revision, {
    shapes,
    xaxis: axis("x, µm", { range, constrain: "domain" }),
    yaxis: axis("y, µm", { range, scaleanchor: "x", scaleratio: 1, constrain: "domain" }),
    hovermode: "closest",
    margin: { l: 52, r: 8, t: 8, b: 40 },
  });
}

const HOVER = "x %{x:.2f} µm, y %{y:.2f} µm<extra></extra>";

/** The path of the shaft in the bearing, its newest point marked. */
export function orbitTraces(orbit) {
  const looks = { name: "path", line: { color: X_COLOUR, width: 1.2 }, hovertemplate: HOVER };
  const path = curve(orbit.shaft_x_um, orbit.shaft_y_um, looks);
  return [path, point(orbit.shaft_x_um.at(-1), orbit.shaft_y_um.at(-1), "newest sample")];
}

export function orbitLayout(orbit) {
  const reach = [...orbit.shaft_x_um, ...orbit.shaft_y_um].reduce((far, um) => Math.max(far, Math.abs(um)), 1);
  // Steps of a quarter octave keep the axes still while the orbit breathes.
  return planeLayout(2 ** (Math.ceil(Math.log2(reach * 1.05) * 4) / 4), "orbit");
}

/** Trail of means from the trends, and the current point unless there is none. */
export function centreTraces(trail, current) {
  const way = curve(trail.map(({ x }) => x), trail.map(({ y }) => y), {
    mode: "lines+markers",
    name: "trail",
    line: { color: FAINT, width: 1 },
    marker: { color: X_BAND, size: 4, line: { color: X_COLOUR, width: 0.5 } },
    hovertemplate: HOVER,
  });
  return current ? [way, point(current.x, current.y, "now")] : [way];
}

export function centreLayout(clearanceUm, trail, current) {
  const reach = (current ? [...trail, current] : trail).reduce((far, { x, y }) => Math.max(far, Math.hypot(x, y)), clearanceUm);
  const circle = {
    type: "circle",
    x0: -clearanceUm,
    x1: clearanceUm,
    y0: -clearanceUm,
    y1: clearanceUm,
    line: { color: INK, width: 1.5 },
  };
  return planeLayout(reach * MARGIN, "centre", [circle]);
}

export function centreCaption(facts, current) {
  const radius = `Circle: clearance, radius ${formatFixed(facts.clearance_um, 0)} µm.`;
  const now = current ? "Cross: now." : "No current point.";
  return `${radius} ${now} Line: means over the chosen span. ${referenceWords(facts.reference)}`;
}

function referenceWords({ set, author, note }) {
  if (set === null) return "Reference: from the plant file.";
  const by = author ? ` by ${author}` : "";
  return `Reference set ${formatTime(Date.parse(set))}${by}${note ? `: ${note}` : "."}`;
}

function point(x, y, name) {
  const marker = { symbol: "cross-thin", size: 15, color: INK, line: { color: INK, width: 2.5 } };
  return points([x], [y], { name, marker, hovertemplate: HOVER });
}
