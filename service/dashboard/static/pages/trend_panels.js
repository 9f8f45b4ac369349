/** Stiffness and amplitude against time, over a span and at an order that the reader chooses. */

import { amplitudeUnit } from "../amplitudes.js";
import { ask } from "../api.js";
import { askBeside, besideWords, expectedTraces, markTraces, namedOnce } from "../charts/beside.js";
import { panel } from "../charts/panel.js";
import { X_COLOUR, Y_COLOUR } from "../charts/style.js";
import { doubtTrace, nOutside, piecesOf, simulatedSentence, trendCaption, trendLayout, trendTraces, valueRange } from "../charts/trend.js";
import { element, setAttribute } from "../dom.js";
import { formatTime, kindOf } from "../format.js";
import { choice } from "../parts/choice.js";
import { readingOf } from "../parts/reading.js";
import { periodFor, poll } from "../poll.js";
import { reasonWords } from "../words.js";
import { addressOf } from "./explorer_state.js";

const MAX_POINTS = 500;

/** The end of the span is a whole minute, so that the same question is asked again until then. */
const WHOLE_MS = 60_000;

const SPANS = [
  [900, "15 min"],
  [3600, "1 h"],
  [8 * 3600, "8 h"],
  [86400, "1 d"],
  [30 * 86400, "30 d"],
  [365 * 86400, "1 y"],
];
const STIFFNESSES = [
  ["stiffness", "Preferred"],
  ["order1_k_eff", "Eq. (5), 1×"],
  ["vortex_k_eff", "Eq. (5), vortex"],
];
const ORDERS = [["order1", "1×"], ["vortex", "Vortex"]];
const SCALES = [["tozero", "From 0"], ["normal", "To fit"]];
const CENTRE = ["shaft_centre_x_um", "shaft_centre_y_um"];

const stiffnessLines = (which) => [
  [`${which}_xx_n_per_m`, "xx", "x", {}],
  [`${which}_yy_n_per_m`, "yy", "y", {}],
];
const amplitudeLines = (order) => [
  [`${order}_shaft_x_um_pk`, "shaft x", "x", {}],
  [`${order}_shaft_y_um_pk`, "shaft y", "y", {}],
  [`${order}_bearing_x_um_pk`, "bearing x", "x", { dash: "dot" }],
  [`${order}_bearing_y_um_pk`, "bearing y", "y", { dash: "dashdot" }],
];

/** Returns `{ nodes, draw(latest, view, notCurrent), newest(), close() }`. */
export function trendPanels(path) {
  let view = null;
  let latest = null;
  let trends = null;
  let beside = null;
  const refresh = () => {
    aim();
    questions.again();
  };
  const span = choice("Span", SPANS, 900, refresh);
  const scale = choice("Scale", SCALES, "tozero", refresh);
  const which = choice("Estimate", STIFFNESSES, "stiffness", refresh);
  const order = choice("Order", ORDERS, "order1", refresh);
  const place = `${path[1]} ${path[3]}`;
  const stiffness = panel(`${place}: film stiffness`, "stiffness-trend", which.node);
  const amplitude = panel(`${place}: vibration amplitude`, "amplitude-trend", order.node);
  const boxes = [stiffness, amplitude];
  const more = element("a", {}, "Compare in Trends");

  /** Lead to the trend explorer with what is shown here. */
  function aim() {
    const names = [...stiffnessLines(which.value()), ...amplitudeLines(order.value())].map(([name]) => name);
    setAttribute(more, "href", addressOf({ quantities: names, bearings: [[path[1], path[3]]], spanS: span.value() }));
  }
  aim();

  const questions = poll(async (signal) => {
    if (view?.serviceTimeMs == null) return;
    const stiffnesses = stiffnessLines(which.value()).map(([name, ...looks]) => [readingOf(latest, name).name, ...looks]);
    const lines = [stiffnesses, amplitudeLines(order.value())];
    const endMs = Math.ceil(view.serviceTimeMs / WHOLE_MS) * WHOLE_MS;
    const range = [endMs - span.value() * 1000, endMs];
    const names = lines[0].map(([name]) => name);
    const key = [...names, ...range].join();
    if (beside?.key !== key) beside = { key, answer: askBeside([path[1], path[3]], names, range) }; // once a minute
    const [newest, marked] = await Promise.all([askTrends(path, lines.flat(), range, signal), beside.answer]);
    trends = newest;
    const asked = { trends, beside: marked, view, span, scale: scale.value(), latest };
    await showTrends(stiffness, asked, lines[0], `Film stiffness, ${kindOf(names[0]).unit}`);
    await showTrends(amplitude, asked, lines[1], `Vibration amplitude, ${amplitudeUnit()}`);
  }, () => periodFor(trends?.bucket_s ?? 0), (failure) => {
    beside = null;
    for (const box of boxes) box.trouble(failure.message);
  });

  return {
    nodes: [element("div", { class: "choices" }, span.node, scale.node, more, hint()), ...boxes.map((box) => box.node)],
    draw(newest, now, notCurrent) {
      const first = view?.serviceTimeMs == null && now.serviceTimeMs !== null;
      [latest, view] = [newest, now];
      if (first) questions.again();
      for (const box of boxes) box.draw(latest.age_s, notCurrent);
    },
    newest: () => trends,
    close: questions.stop,
  };
}

const hint = () => element("span", { class: "hint" }, "Drag in a chart to zoom, double-click to go back.");

function askTrends(path, lines, [startMs, endMs], signal) {
  const query = [...lines.map(([name]) => name), ...CENTRE].map((name) => ["quantity", name]);
  query.push(["start", new Date(startMs).toISOString()], ["end", new Date(endMs).toISOString()]);
  query.push(["max_points", String(MAX_POINTS)]);
  return ask([...path, "trends"], query, signal);
}

async function showTrends(box, { trends, beside, view, span, scale, latest }, lines, title) {
  const all = lines.map(([name]) => piecesOf(trends, name, view.refreshS));
  if (all.flat().length === 0) {
    const { value, reason } = readingOf(latest, lines[0][0]);
    const now = value === null ? `Now: ${reasonWords(reason)}.` : "The first will appear shortly.";
    box.explain(`No value was stored in the last ${span.words()}. ${now}`);
    return;
  }
  const traces = lines.flatMap(([name, label, letter, changes], index) =>
    trendTraces(all[index], name, label, letter, changes),
  );
  const levels = lines.flatMap(([name, , letter]) => expectedTraces(beside, name, letter === "x" ? X_COLOUR : Y_COLOUR));
  const added = namedOnce([...levels, ...markTraces(beside)]);
  const range = valueRange(all, levels, scale === "tozero");
  const layout = trendLayout(trends, title, `${span.value()} ${scale} ${title}`, range);
  if (view.origin === "replay") layout.xaxis.range[0] = formatTime(1000 * all.flat(2).reduce((least, { timeS }) => Math.min(least, timeS), Infinity));
  const words = trendCaption(all, nOutside(all, range)) + simulatedSentence(trends) + besideWords(added, beside.film);
  await box.show([...traces, doubtTrace(all), ...added], layout, words);
}

/** Means of the shaft centre over the chosen span, oldest first; without gaps' empty buckets. */
export function centreTrail(trends) {
  if (trends === null) return [];
  const [xs, ys] = CENTRE.map((name) => trends.series[name].mean);
  return xs.map((x, index) => ({ x, y: ys[index] })).filter(({ x, y }) => x !== null && y !== null);
}
