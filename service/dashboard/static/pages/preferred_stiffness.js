/** The stiffness that alarms and trends use, large, with its uncertainty and its estimator. */

import { element, setText } from "../dom.js";
import { pairView } from "../parts/reading.js";
import { budgetSpread } from "../parts/spread.js";
import { preferredOrigin } from "../words.js";

const NAMES = ["stiffness_xx_n_per_m", "stiffness_yy_n_per_m"];

/** Returns `{ node, draw(latest, saidReason) }`. */
export function preferredStiffness(budget) {
  const pair = pairView(NAMES, ["xx", "yy"], undefined, (name) => budgetSpread(name, budget));
  const estimator = element("span", { class: "from estimator" });
  return {
    node: element("div", { class: "tile large" }, element("h2", {}, "Film stiffness ± 95 %"), pair.node, estimator),
    draw(latest, saidReason) {
      pair.draw(latest, saidReason);
      setText(estimator, preferredOrigin(latest));
    },
  };
}
