/** What is drawn beside the curves of a trend: alarms and notes as marks, and what the baseline expects. */

import { changeWords, kindWords } from "../alarm_words.js";
import { ask } from "../api.js";
import { formatTime, stiffnessShown } from "../format.js";
import { DOUBT_COLOUR, FAINT, INK, curve, points } from "./style.js";

const MAX_EVENTS = "1000";
const MAX_READINGS = "500";
const DIRECTIONS = { stiffness_xx_n_per_m: "x", stiffness_yy_n_per_m: "y", stiffness_xx_of_kb: "x", stiffness_yy_of_kb: "y" };
const LEVEL_LOOKS = {
  alert: { symbol: "triangle-up", color: DOUBT_COLOUR },
  danger: { symbol: "square", color: "var(--bad)" },
};
const RETURNED = { symbol: "circle-open", color: FAINT };
const NOTE = { symbol: "diamond", color: INK };

/**
 * Ask for the alarm events, the notes and the film of a bearing in a time: `{ events, notes, film, readings }`.
 *
 * `film` and `readings` are null where no stiffness is drawn, or the film is not compared with a baseline.
 */
export async function askBeside([unit, bearing], names, [startMs, endMs], signal) {
  const range = [["start", new Date(startMs).toISOString()], ["end", new Date(endMs).toISOString()]];
  const path = ["units", unit, "bearings", bearing, "film"];
  const isFilm = names.some((name) => name in DIRECTIONS);
  const [{ events }, notes, film] = await Promise.all([
    ask(["alarms", "events"], [["unit", unit], ...range, ["limit", MAX_EVENTS]], signal),
    ask(["units", unit, "notes"], range, signal),
    isFilm ? ask(path, [], signal) : null,
  ]);
  const readings = film?.is_watched ? await ask([...path, "readings"], [...range, ["max_points", MAX_READINGS]], signal) : null;
  return {
    events: events.filter(({ subject }) => subject === bearing),
    notes: notes.filter((note) => note.bearing === null || note.bearing === bearing),
    film,
    readings,
  };
}

/** Traces of alarms and notes, each at its time; `place` names the bearing where several are drawn. */
export function markTraces({ events, notes }, place = "") {
  const at = (level) => events.filter((event) => ["raised", "escalated", "eased"].includes(event.change) && event.level === level);
  const words = ({ kind, change }) => `${place}${kindWords(kind)} ${changeWords(change)}`;
  return [
    ...Object.entries(LEVEL_LOOKS).map(([level, look]) => marks(level, at(level), words, look)),
    marks("alarm returned", events.filter(({ change }) => change === "returned"), words, RETURNED),
    marks("note", notes, ({ text, author }) => `${place}${text} (${author})`, NOTE),
  ].filter(({ x }) => x.length > 0);
}

/** Symbols at the top of the chart, each with a line down to the time axis. */
function marks(name, found, wordsOf, look) {
  const x = found.map(({ time }) => formatTime(Date.parse(time)));
  return points(x, found.map(() => 0.97), {
    yaxis: "y2",
    name,
    meta: "mark",
    marker: { ...look, size: 10 },
    error_y: { type: "data", symmetric: false, array: found.map(() => 0), arrayminus: found.map(() => 0.97), width: 0, thickness: 1, color: look.color },
    text: found.map(wordsOf),
    hovertemplate: "%{text}<extra></extra>",
  });
}

/** Traces of the stiffness that the baseline expects, and of the limits of its change; none for another quantity. */
export function expectedTraces({ film, readings }, name, colour, hasLimits = true) {
  const series = readings?.[DIRECTIONS[name]];
  const expected = readings?.time.map((timeS, n) => [timeS, series ? expectedGn(series, n) : null]) ?? [];
  if (!expected.some(([, gn]) => gn !== null)) return [];
  const traces = [levelTrace("expected", [expected], { color: colour, dash: "longdash" })];
  if (!hasLimits) return traces;
  const { alert, danger } = film.limits;
  traces.push(levelTrace("alert limit", [-alert, alert].map((ln) => scaled(expected, ln)), { color: DOUBT_COLOUR, dash: "dash" }));
  traces.push(levelTrace("danger limit", [-danger, danger].map((ln) => scaled(expected, ln)), { color: "var(--bad)", dash: "dot" }));
  return traces;
}

function expectedGn({ stiffness_n_per_m: stiffness, stiffness_of_kb: ratio, deviation_percent: deviation }, n) {
  return deviation[n] === null ? null : stiffnessShown(stiffness[n], ratio[n]).value / (1 + deviation[n] / 100);
}

/** The limits apply to the change of ln(stiffness). */
const scaled = (expected, ln) => expected.map(([timeS, gn]) => [timeS, gn === null ? null : gn * Math.exp(ln)]);

function levelTrace(name, curves, line) {
  const column = curves.flatMap((one) => [...one, [null, null]]);
  const x = column.map(([timeS]) => (timeS === null ? null : formatTime(timeS * 1000)));
  const looks = { name, meta: "level", line: { width: 1, ...line }, connectgaps: false, hoverinfo: "skip" };
  return curve(x, column.map(([, gn]) => gn), looks);
}

/** The same traces, with each name once in the legend. */
export function namedOnce(traces) {
  const names = new Set();
  return traces.map((trace) => {
    const isKnown = trace.name !== undefined && names.has(trace.name);
    names.add(trace.name);
    return isKnown ? { ...trace, legendgroup: trace.name, showlegend: false } : trace;
  });
}

/** How to read what is drawn beside the curves; empty where nothing is. */
export function besideWords(traces, film) {
  const has = (kind) => traces.some(({ meta }) => meta === kind);
  const levels = has("level") ? ` Expected: baseline ${film.baseline_version} under the condition of each reading; limits, where drawn, apply to the mean change of the film.` : "";
  return levels + (has("mark") ? " Symbols at the top: alarms and notes." : "");
}
