/** Stiffness against the condition that it was read under: learned cells, history, today on top. */

import { formatFixed, formatTime, stiffnessShown } from "../format.js";
import { FAINT, INK, axis, baseLayout, points } from "./style.js";

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
      ...stiffnessShown(series.stiffness_n_per_m[index], series.stiffness_of_kb[index]),
      isSettled: readings.is_settled[index],
      isSimulated: readings.provenance[index] === "simulated",
    }))
    .filter((one) => one.isSettled && one.value !== null && one.eccentricity_ratio !== null && one.oil_temperature_c !== null);
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
  const shown = learned.map((cell) => stiffnessShown(cell.stiffness_n_per_m, cell.stiffness_of_kb));
  return points(x, shown.map(({ value }) => value), {
    name: "learned cells ± 95 %",
    error_y: {
      type: "data",
      array: learned.map((cell, n) => (NORMAL_95 * cell.scatter_percent * shown[n].value) / 100),
      thickness: 1,
      width: 0,
      color: INK,
    },
    marker: { symbol: "square", size: 7, color: learned.map((cell) => cell[other]), coloraxis: "coloraxis" },
    text: learned.map((cell, n) => `learned: ${formatFixed(shown[n].value, 3)} ${shown[n].unit}, ${conditionOf(cell)}<br>${cell.n_readings} readings on ${cell.n_days} days, ${cell.support}`),
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
  return points(x, readings.map((one) => one.value), { name, marker, text, hovertemplate: "%{text}<extra></extra>" });
}

const conditionOf = (one) => `eccentricity ${formatFixed(one.eccentricity_ratio, 3)}, oil ${formatFixed(one.oil_temperature_c, 1)} °C`;

function pointWords(one) {
  const source = one.isSimulated ? ", simulated" : "";
  return `${formatFixed(one.value, 3)} ${one.unit}, ${conditionOf(one)}<br>${formatTime(one.timeS * 1000)}${source}`;
}

export function conditionLayout(against, revision, unit = "GN/m") {
  const colour = AXES[otherOf(against)].short;
  return baseLayout(`condition ${revision}`, {
    xaxis: axis(AXES[against].title, { zeroline: false }),
    yaxis: axis(unit, { zeroline: false }),
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
