/** Several lines on one axis, told apart by colour and dash, or coloured by the condition they were read under. */

import { formatFixed, formatTime, kindOf } from "../format.js";
import { FAINT, SERIES } from "./style.js";
import { doubtTrace, piecesOf, trendLayout, trendTraces } from "./trend.js";

const DASHES = ["solid", "dash", "dot", "dashdot", "longdash", "longdashdot", "12px 3px", "3px 6px"];
const SYMBOLS = ["circle", "square", "diamond", "triangle-up", "triangle-down", "cross", "x", "star"];
const BAND_OPACITY = 0.18;

export const MOST_LINES = SERIES.length;

/** One line: a quantity of a bearing; `number` decides how it looks. */
export function lineOf(trends, name, label, number, refreshS) {
  return { trends, name, label, number, pieces: piecesOf(trends, name, refreshS), refreshS };
}

/** Traces of lines; `colourBy` names the condition that colours them, or is empty. */
export function compareTraces(lines, colourBy) {
  const traces = lines.flatMap((line) => (colourBy ? colouredTraces(line, colourBy) : plainTraces(line)));
  return [...traces, doubtTrace(lines.map(({ pieces }) => pieces))];
}

function plainTraces({ pieces, name, label, number }) {
  const colour = SERIES[number % SERIES.length];
  const [band, ...others] = trendTraces(pieces, name, label, "x", { colour, band: colour, dash: DASHES[number % DASHES.length] });
  return [{ ...band, opacity: BAND_OPACITY }, ...others];
}

function colouredTraces(line, colourBy) {
  const { name, label, number, pieces } = line;
  const conditions = new Map(piecesOf(line.trends, colourBy, line.refreshS).flat().map((one) => [one.timeS, one.mean]));
  const points = pieces.flat().filter(({ timeS }) => conditions.has(timeS));
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

/** Layout over the whole requested range; a zoom into the values is kept. */
export function compareLayout(trends, title, colourBy) {
  const layout = trendLayout(trends, title, `${trends.start} ${trends.end}`, "normal");
  layout.yaxis.uirevision = title;
  if (!colourBy) return layout;
  const words = colourBy === "oil_temperature_c" ? "oil, °C" : "ecc.";
  return { ...layout, coloraxis: { colorscale: "Cividis", colorbar: { title: { text: words }, thickness: 12, outlinewidth: 0 } } };
}
