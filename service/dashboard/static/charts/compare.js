/** Several lines on one axis, told apart by colour and dash, or coloured by the condition they were read under. */

import { formatFixed, formatTime, kindOf } from "../format.js";
import { expectedTraces, markTraces, namedOnce } from "./beside.js";
import { FAINT, SERIES, axis } from "./style.js";
import { doubtTrace, piecesOf, trendLayout, trendTraces, valueRange } from "./trend.js";

const DASHES = ["solid", "dash", "dot", "dashdot", "longdash", "longdashdot", "12px 3px", "3px 6px"];
const SYMBOLS = ["circle", "square", "diamond", "triangle-up", "triangle-down", "cross", "x", "star"];
const BAND_OPACITY = 0.18;

export const MOST_LINES = SERIES.length;

/** With more lines, the limits of all of them are not told apart. */
const MOST_WITH_LIMITS = 2;

const CONDITIONS = { oil_temperature_c: ["Oil temperature, °C", "oil, °C"], eccentricity_ratio: ["Eccentricity ratio", "ecc."] };

/** One line: a quantity of a bearing; `number` decides how it looks, `scale` is "y", or "y3" for the axis on the right. */
export function lineOf(trends, name, label, number, scale, refreshS) {
  return { trends, name, label, number, scale, pieces: piecesOf(trends, name, refreshS), refreshS };
}

/** Traces of lines; `colour` of a state names the condition that colours them, or is empty. */
export function compareTraces(lines, colour) {
  const traces = lines.flatMap((line) => (colour ? colouredTraces(line, colour) : plainTraces(line)));
  return [...traces, doubtTrace(lines.map(({ pieces }) => pieces))];
}

/** What is drawn beside the lines: alarms and notes of each bearing, and what is expected of each line. */
export function besideTraces(lines, found) {
  const marks = found.flatMap(({ bearing, beside }) => markTraces(beside, found.length > 1 ? `${bearing.join(" ")}: ` : ""));
  const hasLimits = lines.length <= MOST_WITH_LIMITS;
  const levels = lines.flatMap(({ trends, name, number, scale }) => {
    const { beside } = found.find((one) => one.trends === trends);
    return expectedTraces(beside, name, colourOf(number), hasLimits).map((trace) => ({ ...trace, yaxis: scale }));
  });
  return namedOnce([...levels, ...marks]);
}

/** Points of lines over a condition in place of time. */
export function againstTraces(lines, { against, colour }) {
  return lines.flatMap((line) => {
    const [points, conditions] = pointsOf(line, against);
    const x = points.map(({ timeS }) => conditions.get(timeS));
    const [inColour, colours] = colour ? pointsOf({ ...line, pieces: [points] }, colour) : [[], null];
    const symbol = SYMBOLS[line.number % SYMBOLS.length];
    if (colour) return [{ ...colouredPoints(inColour, colours, line, symbol, colour), x: inColour.map(({ timeS }) => conditions.get(timeS)) }, keyOf(line.label, symbol)];
    const text = points.map(({ timeS }) => formatTime(timeS * 1000));
    const { decimals, unit } = kindOf(line.name);
    return [{ x, y: points.map(({ mean }) => mean), type: "scatter", mode: "markers", name: line.label, marker: { symbol, size: 6, color: colourOf(line.number), opacity: 0.7 }, text, hovertemplate: `${line.label}: %{y:.${decimals}f} ${unit} at %{x}, %{text}<extra></extra>` }];
  });
}

/** Layout of a chart over a condition. */
export function againstLayout(lines, unit, { against, colour }) {
  const layout = compareLayout(lines, [unit], colour, []);
  const xaxis = axis(CONDITIONS[against][0], { zeroline: false });
  return { ...layout, uirevision: `${layout.uirevision} ${against}`, xaxis, hovermode: "closest" };
}

const colourOf = (number) => SERIES[number % SERIES.length];

function plainTraces({ pieces, name, label, number, scale }) {
  const colour = colourOf(number);
  const [band, ...others] = trendTraces(pieces, name, label, "x", { colour, band: colour, dash: DASHES[number % DASHES.length] });
  return [{ ...band, opacity: BAND_OPACITY }, ...others].map((trace) => ({ ...trace, yaxis: scale }));
}

/** The points of a line whose condition is known, and the condition by time. */
function pointsOf({ trends, pieces, refreshS }, condition) {
  const known = new Map(piecesOf(trends, condition, refreshS).flat().map((one) => [one.timeS, one.mean]));
  return [pieces.flat().filter(({ timeS }) => known.has(timeS)), known];
}

function colouredTraces(line, colourBy) {
  const { name, label, number, pieces } = line;
  const [points, conditions] = pointsOf(line, colourBy);
  const [band, ...others] = trendTraces(pieces, name, label, "x", { colour: FAINT, band: FAINT, dash: "solid" });
  const thin = others.filter(({ meta }) => meta !== "random").map((one) => ({ ...one, mode: "lines", line: { ...one.line, width: 1 }, hoverinfo: "skip", hovertemplate: null, showlegend: false }));
  const symbol = SYMBOLS[number % SYMBOLS.length];
  return [{ ...band, opacity: BAND_OPACITY }, ...thin, colouredPoints(points, conditions, line, symbol, colourBy), keyOf(label, symbol)];
}

function colouredPoints(points, conditions, { name, label }, symbol, colourBy) {
  const [kind, condition] = [kindOf(name), kindOf(colourBy)];
  return {
    x: points.map(({ timeS }) => formatTime(timeS * 1000)),
    y: points.map(({ mean }) => mean),
    type: "scatter",
    mode: "markers",
    name: label,
    legendgroup: label,
    showlegend: false,
    meta: "condition",
    marker: { symbol, size: 6, color: points.map(({ timeS }) => conditions.get(timeS)), coloraxis: "coloraxis", line: { width: 0.5, color: FAINT } },
    text: points.map(({ timeS }) => `${formatFixed(conditions.get(timeS), condition.decimals)} ${condition.unit}`),
    hovertemplate: `${label}: %{y:.${kind.decimals}f} ${kind.unit} (%{text})<extra></extra>`,
  };
}

/** A colourless point that stands for a line in the legend. */
const keyOf = (label, symbol) => ({
  x: [null], y: [null], type: "scatter", mode: "markers", name: label, legendgroup: label, marker: { symbol, size: 8, color: FAINT }, hoverinfo: "skip",
});

/** Layout over the whole requested range, with an axis for each of one or two units; a zoom into the values is kept. */
export function compareLayout(lines, units, colour, beside) {
  const [{ trends }] = lines;
  const rangeOf = (scale) => {
    const pieces = lines.filter((line) => line.scale === scale).map((line) => line.pieces);
    return pieces.length ? valueRange(pieces, beside.filter((trace) => trace.yaxis === scale)) : undefined;
  };
  const layout = trendLayout(trends, units[0], `${trends.start} ${trends.end}`, rangeOf("y"));
  layout.yaxis.uirevision = units[0];
  if (units.length > 1) {
    layout.yaxis3 = axis(units[1], { overlaying: "y", side: "right", range: rangeOf("y3"), showgrid: false, tickmode: "auto", automargin: true, uirevision: units[1] });
  }
  if (!colour) return layout;
  return { ...layout, coloraxis: { colorscale: "Cividis", colorbar: { title: { text: CONDITIONS[colour][1] }, thickness: 12, outlinewidth: 0 } } };
}
