/** The stiffness that alarms and trends use, large, with its 95 % interval and its estimator. */

import { element, setText } from "../dom.js";
import { formatInterval } from "../format.js";
import { missingAlike, readingOf, readingView } from "../parts/reading.js";
import { budgetSpread } from "../parts/spread.js";
import { estimatorWords } from "../words.js";

const AXES = ["xx", "yy"];
const nameOf = (axes) => `stiffness_${axes}_n_per_m`;

/** Returns `{ node, draw(latest, saidReason) }`. */
export function preferredStiffness(budget) {
  const views = AXES.map((axes) => axisView(axes, budget));
  const pair = element("div", { class: "preferred" }, ...views.map((view) => view.node));
  return {
    node: element("div", { class: "tile large" }, element("h2", {}, "Film stiffness"), pair),
    draw(latest, saidReason) {
      for (const view of views) view.draw(latest, saidReason);
      pair.classList.toggle("merged", missingAlike(latest, AXES.map(nameOf)));
    },
  };
}

function axisView(axes, budget) {
  const name = nameOf(axes);
  const number = readingView(name, axes, undefined, budgetSpread(name, budget));
  const interval = element("span", { class: "interval" });
  const estimator = element("span", { class: "estimator" });
  const detail = element("div", { class: "from" }, interval, " ", estimator);
  return {
    node: element("div", { class: "preferred-axis" }, number.node, detail),
    draw(latest, saidReason) {
      number.draw(latest, saidReason);
      const { value, uncertainty } = readingOf(latest, name);
      const known = value !== null && uncertainty;
      setText(interval, known ? `95 %: ${formatInterval(name, uncertainty)},` : "");
      setText(estimator, estimatorWords(latest.estimators?.[axes] ?? null));
    },
  };
}
