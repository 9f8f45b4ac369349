/** Stiffness and amplitude against time, over a span and at an order that the reader chooses. */

import { NotReachable, ask } from "../api.js";
import { panel } from "../charts/panel.js";
import { doubtTrace, piecesOf, trendCaption, trendLayout, trendTraces } from "../charts/trend.js";
import { element } from "../dom.js";
import { choice } from "../parts/choice.js";
import { readingOf } from "../parts/reading.js";
import { poll } from "../poll.js";
import { reasonWords } from "../words.js";

const SHORTEST_PERIOD_S = 5;
const LONGEST_PERIOD_S = 60;
const MAX_POINTS = 500;

const SPANS = [
  [900, "15 min"],
  [3600, "1 h"],
  [8 * 3600, "8 h"],
  [86400, "1 d"],
  [30 * 86400, "30 d"],
  [365 * 86400, "1 y"],
];
const ORDERS = [["order1", "1×"], ["vortex", "Vortex"]];
const CENTRE = ["shaft_centre_x_um", "shaft_centre_y_um"];

const stiffnessLines = (order) => [
  [`${order}_k_eff_xx_n_per_m`, "xx", "x", {}],
  [`${order}_k_eff_yy_n_per_m`, "yy", "y", {}],
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
  const refresh = () => questions.again();
  const span = choice("Span", SPANS, 900, refresh);
  const order = choice("Order", ORDERS, "order1", refresh);
  const stiffness = panel("Film stiffness k_eff", "stiffness-trend");
  const amplitude = panel("Vibration amplitude", "amplitude-trend");
  const boxes = [stiffness, amplitude];

  const questions = poll(async (signal) => {
    if (view?.serviceTimeMs == null) return;
    try {
      trends = await askTrends(path, order.value(), span.value(), view.serviceTimeMs, signal);
      const asked = { trends, refreshS: view.refreshS, span, latest };
      await showTrends(stiffness, asked, stiffnessLines(order.value()), "GN/m");
      await showTrends(amplitude, asked, amplitudeLines(order.value()), "µm 0-pk");
    } catch (failure) {
      if (signal.aborted) return;
      const words = failure instanceof NotReachable ? `Service not reachable. ${failure.message}` : failure.message;
      for (const box of boxes) box.trouble(words);
    }
  }, () => periodS(trends));

  return {
    nodes: [element("div", { class: "choices" }, span.node, order.node, hint()), ...boxes.map((box) => box.node)],
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

/** A year of trends does not change within five seconds. */
function periodS(trends) {
  return Math.min(Math.max(trends?.bucket_s ?? 0, SHORTEST_PERIOD_S), LONGEST_PERIOD_S);
}

function askTrends(path, order, spanS, endMs, signal) {
  const names = [...stiffnessLines(order), ...amplitudeLines(order)].map(([name]) => name);
  const query = [...names, ...CENTRE].map((name) => ["quantity", name]);
  query.push(["start", new Date(endMs - spanS * 1000).toISOString()], ["end", new Date(endMs).toISOString()]);
  query.push(["max_points", String(MAX_POINTS)]);
  return ask([...path, "trends"], query, signal);
}

async function showTrends(box, { trends, refreshS, span, latest }, lines, title) {
  const all = lines.map(([name]) => piecesOf(trends, name, refreshS));
  if (all.flat().length === 0) {
    const { value, reason } = readingOf(latest, lines[0][0]);
    const now = value === null ? `Now: ${reasonWords(reason)}.` : "The first will appear shortly.";
    box.explain(`No value was stored in the last ${span.words()}. ${now}`);
    return;
  }
  const traces = lines.flatMap(([name, label, letter, changes], index) =>
    trendTraces(all[index], name, label, letter, changes),
  );
  await box.show([...traces, doubtTrace(all)], trendLayout(trends, title, `${span.value()} ${title}`), trendCaption(all));
}

/** Means of the shaft centre over the chosen span, oldest first; without gaps' empty buckets. */
export function centreTrail(trends) {
  if (trends === null) return [];
  const [xs, ys] = CENTRE.map((name) => trends.series[name].mean);
  return xs.map((x, index) => ({ x, y: ys[index] })).filter(({ x, y }) => x !== null && y !== null);
}
