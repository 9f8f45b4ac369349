/** Several lines on one axis, told apart by colour and dash, over time or over the condition they were read under. */

import { formatTime, kindOf } from "../format.js";
import { expectedTraces, markTraces, namedOnce } from "./beside.js";
import { SERIES, axis, points } from "./style.js";
import { doubtTrace, piecesOf, trendLayout, trendTraces, valueRange } from "./trend.js";

const DASHES = ["solid", "dash", "dot", "dashdot", "longdash", "longdashdot", "12px 3px", "3px 6px"];
const SYMBOLS = ["circle", "square", "diamond", "triangle-up", "triangle-down", "cross", "x", "star"];
const BAND_OPACITY = 0.18;

export const MOST_LINES = SERIES.length;

/** With more lines, the limits of all of them are not told apart. */
const MOST_WITH_LIMITS = 2;

const CONDITIONS = { oil_temperature_c: "Oil temperature, °C", eccentricity_ratio: "Eccentricity ratio" };

/** One line: a quantity of a bearing; `number` decides how it looks, `scale` is "y", or "y3" for the axis on the right. */
export function lineOf(trends, name, label, number, scale, refreshS) {
  return { trends, name, label, number, scale, pieces: piecesOf(trends, name, refreshS), refreshS };
}

/** Traces of lines over time. */
export const compareTraces = (lines) => [...lines.flatMap(plainTraces), doubtTrace(lines.map(({ pieces }) => pieces))];

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

/** Points of lines over a condition in place of time, where it is known. */
export function againstTraces(lines, against) {
  return lines.map(({ trends, pieces, name, label, number, refreshS }) => {
    const conditions = new Map(piecesOf(trends, against, refreshS).flat().map(({ timeS, mean }) => [timeS, mean]));
    const known = pieces.flat().filter(({ timeS }) => conditions.has(timeS));
    const { decimals, unit } = kindOf(name);
    return points(known.map(({ timeS }) => conditions.get(timeS)), known.map(({ mean }) => mean), {
      name: label,
      marker: { symbol: SYMBOLS[number % SYMBOLS.length], size: 6, color: colourOf(number), opacity: 0.7 },
      text: known.map(({ timeS }) => formatTime(timeS * 1000)),
      hovertemplate: `${label}: %{y:.${decimals}f} ${unit} at %{x}, %{text}<extra></extra>`,
    });
  });
}

/** Layout of a chart over a condition. */
export function againstLayout(lines, unit, against) {
  const layout = compareLayout(lines, [unit], []);
  const xaxis = axis(CONDITIONS[against], { zeroline: false });
  return { ...layout, uirevision: `${layout.uirevision} ${against}`, xaxis, hovermode: "closest" };
}

const colourOf = (number) => SERIES[number % SERIES.length];

function plainTraces({ pieces, name, label, number, scale }) {
  const colour = colourOf(number);
  const [band, ...others] = trendTraces(pieces, name, label, "x", { colour, band: colour, dash: DASHES[number % DASHES.length] });
  return [{ ...band, opacity: BAND_OPACITY }, ...others].map((trace) => ({ ...trace, yaxis: scale }));
}

/** Layout over the whole requested range, with an axis for each of one or two units; a zoom into the values is kept. */
export function compareLayout(lines, units, beside) {
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
  return layout;
}
