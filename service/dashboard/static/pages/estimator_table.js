/** All estimators of a bearing's film side by side. */

import { element, setText } from "../dom.js";
import { budgetPanel } from "../parts/budget.js";
import { listingCell, listingName, tableOf } from "../parts/listing.js";
import { drawQuality, mark } from "../parts/mark.js";
import { readingOf, readingView } from "../parts/reading.js";
import { budgetSpread } from "../parts/spread.js";
import { estimatorWords, qualityOf } from "../words.js";

const LINE_COHERENCE = (line) => [`${line}_coherence_xx`, `${line}_coherence_yy`];
const TRANSFER = (line) => ({ k: `${line}_transfer_k`, c: `${line}_transfer_c`, coherence: LINE_COHERENCE(line) });
const RATIO = (line) => ({ k: `${line}_k_eff`, c: null, coherence: LINE_COHERENCE(line) });

const ROWS = {
  dynamic: { k: "dynamic_k", c: "dynamic_c", coherence: ["dynamic_coherence_x", "dynamic_coherence_y"] },
  transfer_order1: TRANSFER("order1"),
  transfer_vortex: TRANSFER("vortex"),
  ratio_order1: RATIO("order1"),
  ratio_vortex: RATIO("vortex"),
};

const HEADS = [
  ["Estimator", ""],
  ["k xx", "GN/m"],
  ["k yy", "GN/m"],
  ["c xx", "MN·s/m"],
  ["c yy", "MN·s/m"],
  ["Coherence x", ""],
  ["Coherence y", ""],
  ["Quality", ""],
];
const DAMPING_INCLUDED = "not available from equation (5)";

/** Returns `{ node, draw(latest), close() }`. */
export function estimatorTable(path) {
  const budget = budgetPanel(path);
  const rows = Object.entries(ROWS).map(([estimator, names]) => estimatorRow(estimator, names, budget));
  const heads = HEADS.map(([head, unit]) => [head, element("small", {}, unit)]);
  const table = tableOf("Estimators", heads, ...rows.map((row) => row.node));
  const hint = element("p", { class: "help" }, "±: half the 95 % interval; press one for its uncertainty budget.");
  return {
    node: element("section", { class: "panel estimators" }, element("h2", {}, "Estimators"), table, hint, budget.node),
    draw(latest) {
      for (const row of rows) row.draw(latest);
    },
    close: budget.close,
  };
}

function estimatorRow(estimator, { k, c, coherence }, budget) {
  const stiffness = ["xx", "yy"].map((axes) => `${k}_${axes}_n_per_m`);
  const damping = c ? ["xx", "yy"].map((axes) => `${c}_${axes}_n_s_per_m`) : [];
  const names = [...stiffness, ...damping, ...coherence];
  const views = names.map((name) => readingView(name, "", "", budgetSpread(name, budget)));
  const cells = views.map((view, index) => cell(view.node, HEADS[1 + index + (c || index < 2 ? 0 : 2)]));
  if (!c) cells.splice(2, 0, element("td", { role: "cell", colspan: 2, class: "none" }, DAMPING_INCLUDED));
  const preferred = element("small");
  const quality = mark();
  const head = listingName(estimatorWords(estimator), " ", preferred);
  const node = element("tr", { role: "row", "data-estimator": estimator }, head, ...cells, cell(quality.node, HEADS.at(-1)));
  return {
    node,
    draw(latest) {
      node.hidden = /_vortex$/.test(estimator) && readingOf(latest, "vortex_frequency_hz").reason === "no_vortex";
      const whole = worstOf(names.map((name) => readingOf(latest, name)));
      for (const view of views) view.draw(latest, whole.reason);
      drawQuality(quality, whole, qualityOf(latest).reason);
      setText(preferred, preferredWords(latest.estimators ?? {}, estimator));
    },
  };
}

const cell = (node, [head, unit]) => listingCell(unit ? `${head}, ${unit}` : head, node);

function worstOf(readings) {
  const first = (level) => readings.find((reading) => reading.level === level);
  return first("bad") ?? first("uncertain") ?? readings[0];
}

function preferredWords(estimators, estimator) {
  const axes = Object.keys(estimators).filter((one) => estimators[one] === estimator);
  if (axes.length === 0) return "";
  return axes.length === 2 ? "preferred" : `preferred for ${axes[0]}`;
}
