/** The baseline as a map: eccentricity × oil temperature, colour = stiffness, support visible. */

import { formatFixed, stiffnessShown } from "../format.js";
import { FAINT, INK, PLOT, axis, baseLayout, points } from "./style.js";

const SCALE = "Cividis"; // even to the eye, also without red or green
const shownOf = (cell) => stiffnessShown(cell.stiffness_n_per_m, cell.stiffness_of_kb);

/** Cells as objects; of several attitudes in one place the one with most readings. */
export function cellsOf(columns) {
  const places = new Map();
  columns.support.forEach((_, index) => {
    const cell = Object.fromEntries(Object.entries(columns).map(([name, values]) => [name, values?.[index] ?? null]));
    const place = `${cell.eccentricity_low} ${cell.oil_temperature_low_c}`;
    if ((places.get(place)?.n_readings ?? -1) < cell.n_readings) places.set(place, cell);
  });
  return [...places.values()];
}

const middle = (cell) => [
  (cell.eccentricity_low + cell.eccentricity_high) / 2,
  (cell.oil_temperature_low_c + cell.oil_temperature_high_c) / 2,
];

/** What there is to say of one cell. */
function words(cell) {
  const support = { own: "learned here", borrowed: "interpolated", none: "too few readings" }[cell.support];
  return [
    `<b>${formatFixed(shownOf(cell).value, 3)} ${shownOf(cell).unit}</b>, ${support}`,
    `eccentricity ${formatFixed(cell.eccentricity_low, 3)} to ${formatFixed(cell.eccentricity_high, 3)}`,
    `oil ${formatFixed(cell.oil_temperature_low_c, 1)} to ${formatFixed(cell.oil_temperature_high_c, 1)} °C`,
    `${cell.n_readings} readings on ${cell.n_days} days`,
    `scatter ${formatFixed(cell.scatter_percent, 1)} %, surface ± ${formatFixed(1.96 * cell.surface_std_percent, 1)} %`,
  ].join("<br>");
}

/** Bins from the lowest to the highest of some cells, as middles. */
function middles(cells, low, width) {
  const lows = cells.map((cell) => cell[low]);
  const first = Math.min(...lows);
  const n = Math.round((Math.max(...lows) - first) / width) + 1;
  return Array.from({ length: n }, (_, index) => first + (index + 0.5) * width);
}

export function mapTraces(cells, widths) {
  const own = cells.filter((cell) => cell.support === "own");
  const borrowed = cells.filter((cell) => cell.support === "borrowed");
  const seldom = cells.filter((cell) => cell.support === "none");
  const grid = [middles(cells, "eccentricity_low", widths[0]), middles(cells, "oil_temperature_low_c", widths[1])];
  return [
    surface(own, grid, widths, "learned here", 1),
    surface(borrowed, grid, widths, "interpolated", 0.5),
    marks(borrowed, "interpolated", { symbol: "line-ne", size: 13, line: { color: INK, width: 1 } }),
    marks(seldom, "too few readings", { symbol: "x-thin", size: 7, line: { color: FAINT, width: 1.2 } }),
  ].filter((trace) => trace.x.length > 0);
}

function surface(cells, [x, y], widths, name, opacity) {
  const blank = () => y.map(() => x.map(() => null));
  const [z, text] = [blank(), blank()];
  for (const cell of cells) {
    const [e, c] = middle(cell);
    const [column, row] = [Math.round((e - x[0]) / widths[0]), Math.round((c - y[0]) / widths[1])];
    z[row][column] = shownOf(cell).value;
    text[row][column] = words(cell);
  }
  return {
    type: "heatmap",
    name,
    x,
    y,
    z,
    text,
    opacity,
    coloraxis: "coloraxis",
    xgap: 1,
    ygap: 1,
    hoverongaps: false,
    hovertemplate: "%{text}<extra></extra>",
  };
}

function marks(cells, name, marker) {
  const [x, y] = [0, 1].map((n) => cells.map((cell) => middle(cell)[n]));
  return points(x, y, { name, text: cells.map(words), marker, hovertemplate: "%{text}<extra></extra>" });
}

/** Layout with the current cell outlined; `revision` keeps a zoom. */
export function mapLayout(cells, current, revision) {
  const all = current ? [...cells, current] : cells;
  const ends = (low, high) => [Math.min(...all.map((c) => c[low])), Math.max(...all.map((c) => c[high]))];
  return baseLayout(`map ${revision}`, {
    xaxis: axis("Eccentricity ratio", { range: ends("eccentricity_low", "eccentricity_high"), zeroline: false }),
    yaxis: axis("Oil temperature, °C", { range: ends("oil_temperature_low_c", "oil_temperature_high_c"), zeroline: false }),
    coloraxis: { colorscale: SCALE, colorbar: { title: { text: shownOf(cells[0] ?? {}).unit }, thickness: 12, outlinewidth: 0 } },
    shapes: current ? [outline(current, PLOT, 5), outline(current, INK, 2.5)] : [],
    hovermode: "closest",
    margin: { l: 56, r: 8, t: 8, b: 40 },
  });
}

function outline(cell, color, width) {
  return {
    type: "rect",
    x0: cell.eccentricity_low,
    x1: cell.eccentricity_high,
    y0: cell.oil_temperature_low_c,
    y1: cell.oil_temperature_high_c,
    line: { color, width },
  };
}

export function mapCaption(cells, current) {
  const n = (support) => cells.filter((cell) => cell.support === support).length;
  const counted = `${n("own")} cells learned (solid), ${n("borrowed")} interpolated (pale, struck through), ${n("none")} with too few readings (cross).`;
  if (!current) return `${counted} The rest has never been seen. No current cell.`;
  const here = cells.find((cell) => cell.eccentricity_low === current.eccentricity_low && cell.oil_temperature_low_c === current.oil_temperature_low_c);
  const where = here && here.support !== "none" ? "Outlined: where the bearing runs now." : "Outlined: where the bearing runs now, which has not been learned.";
  return `${counted} The rest has never been seen. ${where}`;
}
