/** The charts of the trend explorer: one for each kind of quantity, a sentence where there is nothing. */

import { NotReachable } from "../api.js";
import { MOST_LINES, compareLayout, compareTraces, lineOf } from "../charts/compare.js";
import { panel } from "../charts/panel.js";
import { simulatedSentence, trendCaption } from "../charts/trend.js";
import { element } from "../dom.js";
import { formatTime } from "../format.js";
import { stateWords } from "../film_words.js";
import { byAxis } from "../quantity_groups.js";

/** A double click also makes the chart reset itself, which is not a zoom of the user. */
const AFTER_DOUBLE_MS = 500;

/** Returns `{ node, show(found, state, labels, refreshS), trouble(failure), draw(notCurrent) }`. */
export function explorerCharts(onZoom, onBack) {
  const node = element("div", { class: "charts explorer-charts" });
  const panels = new Map();

  function panelsFor(axes) {
    for (const key of panels.keys()) if (!axes.some((one) => keyOf(one) === key)) panels.delete(key);
    for (const one of axes) if (!panels.has(keyOf(one))) panels.set(keyOf(one), panel(one.title, nameOf(one)));
    const wanted = axes.map((one) => panels.get(keyOf(one)).node);
    if (wanted.some((one, n) => node.children[n] !== one) || node.childElementCount !== wanted.length) node.replaceChildren(...wanted);
  }

  return {
    node,
    /** `found` is a list of `{ bearing: [unit, bearing], trends }`. */
    async show(found, state, labels, refreshS) {
      const axes = byAxis(state.quantities, labels);
      panelsFor(axes);
      for (const one of axes) {
        const box = panels.get(keyOf(one));
        await showAxis(box, one, found, state, refreshS);
        wire(box.node.querySelector(".chart"), onZoom, onBack);
      }
    },
    explain(words) {
      panels.clear();
      node.replaceChildren(element("p", { class: "sentence panel" }, words));
    },
    trouble(failure) {
      const words = failure instanceof NotReachable ? `Service not reachable. ${failure.message}` : failure.message;
      if (panels.size === 0) this.explain(words);
      for (const box of panels.values()) box.trouble(words);
    },
    draw(notCurrent) {
      for (const box of panels.values()) box.draw(null, notCurrent);
    },
  };
}

const keyOf = ({ chart, title }) => `${chart}: ${title}`;
const nameOf = ({ chart }) => `trend-${chart.replace(/\W+/g, "-")}`;

async function showAxis(box, { unit, names, title, words }, found, state, refreshS) {
  const pairs = found.flatMap(({ bearing, trends }) => names.map((name) => ({ bearing, trends, name })));
  const shown = pairs.slice(0, MOST_LINES);
  const lines = shown.map(({ bearing, trends, name }, n) => lineOf(trends, name, lineLabel(bearing, words.get(name), found.length > 1) || title, n, refreshS));
  const [full, empty] = [lines.filter(hasData), lines.filter((line) => !hasData(line))];
  if (full.length === 0) {
    box.explain(emptyWords(lines, found[0].trends, state));
    return;
  }
  const layout = compareLayout(full[0].trends, unit, state.colour);
  const sentences = [
    trendCaption(full.map(({ pieces }) => (state.colour ? withoutRandom(pieces) : pieces))) + simulatedSentence(full[0].trends),
    COLOURED[state.colour] ?? "",
    empty.length ? `No value in this time: ${empty.map(({ label }) => label).join("; ")}.` : "",
    pairs.length > shown.length ? `Only the first ${MOST_LINES} of ${pairs.length} lines are drawn; choose fewer quantities or bearings.` : "",
  ];
  await box.show(compareTraces(full, state.colour), layout, sentences.filter(Boolean).join(" "));
}

const COLOURED = {
  oil_temperature_c: "Colour: oil temperature, where it is known; shapes tell the lines apart.",
  eccentricity_ratio: "Colour: eccentricity, where it is known; shapes tell the lines apart.",
};

/** Coloured points go without the lines of their uncertainty. */
const withoutRandom = (pieces) => pieces.map((piece) => piece.map((bucket) => ({ ...bucket, random: null })));

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
    if (performance.now() - doubleMs < AFTER_DOUBLE_MS) return;
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
