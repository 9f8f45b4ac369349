/** Stiffness against the condition that it was read under: learned cells, history, today on top. */

import { formatFixed, formatTime } from "../format.js";
import { FAINT, INK, axis, baseLayout, points } from "./style.js";

const GN = 1e9;
const NORMAL_95 = 1.96;

export const AXES = {
  eccentricity_ratio: { title: "Eccentricity ratio", short: "ecc.", decimals: 3, unit: "" },
  oil_temperature_c: { title: "Oil temperature, °C", short: "oil, °C", decimals: 1, unit: " °C" },
};

const otherOf = (against) => (against === "eccentricity_ratio" ? "oil_temperature_c" : "eccentricity_ratio");

/** Settled readings with a number, as points. */
export function pointsOf(readings, direction) {
  const series = readings[direction];
  return readings.time
    .map((timeS, index) => ({
      timeS,
      eccentricity_ratio: readings.eccentricity_ratio[index],
      oil_temperature_c: readings.oil_temperature_c[index],
      gn: series.stiffness_n_per_m[index] === null ? null : series.stiffness_n_per_m[index] / GN,
      isSettled: readings.is_settled[index],
      isSimulated: readings.provenance[index] === "simulated",
    }))
    .filter((one) => one.isSettled && one.gn !== null && one.eccentricity_ratio !== null && one.oil_temperature_c !== null);
}

export function conditionTraces({ cells, history, today }, against) {
  const traces = [historyTrace(history, against), cellTrace(cells, against), todayTrace(today, against)];
  return traces.filter((trace) => trace.x.length > 0).flatMap(withKey);
}

/** A trace whose points have colours of their own, and a colourless one that stands for it in the legend. */
function withKey(trace) {
  if (!trace.marker.coloraxis) return [trace];
  const { symbol = "circle", size, line } = trace.marker;
  const key = points([null], [null], { name: trace.name, marker: { symbol, size, line, color: FAINT }, hoverinfo: "skip" });
  return [{ ...trace, showlegend: false }, key];
}

function historyTrace(readings, against) {
  return placed(readings, against, "history", { size: 3.5, color: FAINT, opacity: 0.35 });
}

function cellTrace(cells, against) {
  const learned = cells.filter((cell) => cell.support !== "none" && cell.n_readings > 0);
  const other = otherOf(against);
  const x = learned.map((cell) => cell[against]);
  return points(x, learned.map((cell) => cell.stiffness_n_per_m / GN), {
    name: "learned cells ± 95 %",
    error_y: {
      type: "data",
      array: learned.map((cell) => (NORMAL_95 * cell.scatter_percent * cell.stiffness_n_per_m) / 100 / GN),
      thickness: 1,
      width: 0,
      color: INK,
    },
    marker: { symbol: "square", size: 7, color: learned.map((cell) => cell[other]), coloraxis: "coloraxis" },
    text: learned.map((cell) => `learned: ${formatFixed(cell.stiffness_n_per_m / GN, 3)} GN/m, ${conditionOf(cell)}<br>${cell.n_readings} readings on ${cell.n_days} days, ${cell.support}`),
    hovertemplate: "%{text}<extra></extra>",
  });
}

function todayTrace(readings, against) {
  const color = readings.map((one) => one[otherOf(against)]);
  return placed(readings, against, "today", { size: 9, color, coloraxis: "coloraxis", line: { color: INK, width: 1.5 } });
}

function placed(readings, against, name, marker) {
  const x = readings.map((one) => one[against]);
  const text = readings.map(pointWords);
  return points(x, readings.map((one) => one.gn), { name, marker, text, hovertemplate: "%{text}<extra></extra>" });
}

const conditionOf = (one) => `eccentricity ${formatFixed(one.eccentricity_ratio, 3)}, oil ${formatFixed(one.oil_temperature_c, 1)} °C`;

function pointWords(one) {
  const source = one.isSimulated ? ", simulated" : "";
  return `${formatFixed(one.gn, 3)} GN/m, ${conditionOf(one)}<br>${formatTime(one.timeS * 1000)}${source}`;
}

export function conditionLayout(against, revision) {
  const colour = AXES[otherOf(against)].short;
  return baseLayout(`condition ${revision}`, {
    xaxis: axis(AXES[against].title, { zeroline: false }),
    yaxis: axis("GN/m", { zeroline: false }),
    coloraxis: { colorscale: "Cividis", colorbar: { title: { text: colour }, thickness: 12, outlinewidth: 0 } },
    hovermode: "closest",
    margin: { l: 56, r: 8, t: 8, b: 40 },
  });
}

export function conditionCaption({ cells, history, today }, against, spanWords) {
  const colour = AXES[otherOf(against)].title.split(",")[0].toLowerCase();
  const learned = cells.length ? "Squares: learned cells with the scatter of single readings, 95 %." : "No baseline to compare with yet.";
  const simulated = [...history, ...today].filter((one) => one.isSimulated).length;
  const marked = simulated ? ` ${simulated} of the points are simulated.` : "";
  const newest = today.length ? `Circles: the last 24 h, ${today.length} readings.` : "No settled reading in the last 24 h.";
  return `${learned} ${newest} Pale: ${history.length} readings of the last ${spanWords}. Colour: ${colour}.${marked}`;
}
