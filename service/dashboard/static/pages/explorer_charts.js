/** The charts of the trend explorer: one for each kind of quantity, a sentence where there is nothing. */

import { besideWords } from "../charts/beside.js";
import { MOST_LINES, againstLayout, againstTraces, besideTraces, compareLayout, compareTraces, lineOf } from "../charts/compare.js";
import { panel } from "../charts/panel.js";
import { nOutside, simulatedSentence, spanCaption, trendCaption } from "../charts/trend.js";
import { element } from "../dom.js";
import { formatTime } from "../format.js";
import { stateWords } from "../film_words.js";
import { byAxis } from "../quantity_groups.js";
import { isOverTime } from "./explorer_state.js";

/** A double click also makes the chart reset itself, which is not a zoom of the user. */
const AFTER_DOUBLE_MS = 500;

/** Returns `{ node, show(found, state, labels, refreshS), explain(sentence), trouble(failure), draw(notCurrent) }`. */
export function explorerCharts(onZoom, onBack) {
  const node = element("div", { class: "charts explorer-charts" });
  const panels = new Map();

  function panelsFor(axes) {
    for (const key of panels.keys()) if (!axes.some((one) => keyOf(one) === key)) panels.delete(key);
    for (const one of axes) if (!panels.has(keyOf(one))) panels.set(keyOf(one), panel(one.title, nameOf(one)));
    const wanted = axes.map((one) => panels.get(keyOf(one)).node);
    if (wanted.some((one, n) => node.children[n] !== one) || node.childElementCount !== wanted.length) node.replaceChildren(...wanted);
  }

  function explain(words) {
    panels.clear();
    node.replaceChildren(element("p", { class: "sentence panel" }, words));
  }

  return {
    node,
    /** `found` is a list of `{ bearing: [unit, bearing], trends, beside }`; see `askBeside`. */
    async show(found, state, labels, refreshS) {
      const axes = chartsOf(byAxis(state.quantities, labels), found, state.form);
      panelsFor(axes);
      for (const one of axes) {
        const box = panels.get(keyOf(one));
        await showAxis(box, one, found, state, refreshS);
        wire(box.node.querySelector(".chart"), onZoom, onBack);
      }
    },
    explain,
    trouble({ message }) {
      if (panels.size === 0) explain(message);
      for (const box of panels.values()) box.trouble(message);
    },
    draw(notCurrent) {
      for (const box of panels.values()) box.draw(null, notCurrent);
    },
  };
}

const keyOf = ({ chart, title }) => `${chart}: ${title}`;
const nameOf = ({ chart }) => `trend-${chart.replace(/\W+/g, "-")}`;

/** Kinds of quantities as charts: `title` names bearings, quantities and unit; with two axes the first two kinds share one. */
function chartsOf(axes, found, form) {
  const place = found.map(({ bearing }) => bearing.join(" ")).join(", ");
  const groups = form === "two" && axes.length > 1 ? [axes.slice(0, 2), ...axes.slice(2).map((one) => [one])] : axes.map((one) => [one]);
  return groups.map((parts) => ({
    chart: parts[0].chart,
    parts,
    title: `${place}: ${parts.map(({ title, unit }) => [title, unit].filter(Boolean).join(", ")).join("; ")}`,
  }));
}

async function showAxis(box, { parts }, found, state, refreshS) {
  const pairs = parts.flatMap(({ title, names, words }, n) =>
    found.flatMap(({ bearing, trends }) => names.map((name) => {
      const own = words.get(name) || (parts.length > 1 ? title : "");
      return { trends, name, label: lineLabel(bearing, own, found.length > 1) || title, scale: n === 0 ? "y" : "y3" };
    })),
  );
  const shown = pairs.slice(0, MOST_LINES);
  const lines = shown.map(({ trends, name, label, scale }, n) => lineOf(trends, name, label, n, scale, refreshS));
  const [full, empty] = [lines.filter(hasData), lines.filter((line) => !hasData(line))];
  if (full.length === 0) {
    box.explain(emptyWords(lines, found[0].trends, state));
    return;
  }
  const units = parts.map(({ unit }) => unit);
  const isTime = isOverTime(state);
  const beside = isTime ? besideTraces(full, found) : [];
  const layout = isTime ? compareLayout(full, units, beside) : againstLayout(full, units[0], state.form);
  const traces = isTime ? [...compareTraces(full), ...beside] : againstTraces(full, state.form);
  const pieces = full.map((line) => line.pieces);
  const nBeyond = full.reduce((sum, line) => sum + nOutside(line.pieces, layout[line.scale.replace("y", "yaxis")].range), 0);
  const sentences = [
    isTime ? trendCaption(pieces, nBeyond) : `${spanCaption(pieces)} Points: means.`,
    simulatedSentence(full[0].trends).trim(),
    besideWords(beside, found.find((one) => one.beside.film)?.beside.film),
    empty.length ? `No value in this time: ${empty.map(({ label }) => label).join("; ")}.` : "",
    pairs.length > shown.length ? `Only the first ${MOST_LINES} of ${pairs.length} lines are drawn; choose fewer quantities or bearings.` : "",
  ];
  await box.show(traces, layout, sentences.filter(Boolean).join(" "));
}

const hasData = ({ pieces }) => pieces.length > 0;

/** Text that distinguishes a line from the others of its chart. */
function lineLabel([unit, bearing], words, hasOthers) {
  return [hasOthers ? `${unit} ${bearing}` : "", words].filter(Boolean).join(": ");
}

/** Why there is nothing to draw. */
function emptyWords(lines, trends, state) {
  const range = `from ${formatTime(Date.parse(trends.start))} to ${formatTime(Date.parse(trends.end))}`;
  const filter = state.state ? ` at ${stateWords(state.state)}` : "";
  const anything = lines.some((line) => line.trends.time.length > 0);
  if (anything) return `Results were stored ${range}${filter}, but none of them had a usable value of this.`;
  const advice = state.state ? " Look at all operating states, or at another time." : " Choose another time, or zoom out.";
  return `Nothing was stored ${range}${filter}.${advice}`;
}

/** Dragging and double-clicking in a chart, once for each chart. */
function wire(chart, onZoom, onBack) {
  if (!chart.on || chart.dataset.zooms) return;
  chart.dataset.zooms = "yes";
  let doubleMs = -Infinity;
  chart.on("plotly_relayout", (change) => {
    if (performance.now() - doubleMs < AFTER_DOUBLE_MS || chart.layout.xaxis.type !== "date") return;
    const [from, to] = [change["xaxis.range[0]"], change["xaxis.range[1]"]];
    if (from !== undefined && to !== undefined) onZoom(momentOf(from), momentOf(to));
  });
  chart.on("plotly_doubleclick", () => {
    doubleMs = performance.now();
    onBack();
  });
}

/** Plotly writes local time with a blank: 2026-07-01 03:12:45.6789. */
const momentOf = (text) => new Date(String(text).replace(" ", "T")).getTime();
