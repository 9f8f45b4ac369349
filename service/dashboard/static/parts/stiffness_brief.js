/** The stiffness that alarms and trends use, and the estimator it comes from. */

import { element, setText } from "../dom.js";
import { preferredOrigin } from "../words.js";
import { pairView } from "./reading.js";

/** Returns `{ node, draw(latest, saidReason) }`. */
export function stiffnessBrief() {
  const pair = pairView(["stiffness_xx_n_per_m", "stiffness_yy_n_per_m"], ["xx", "yy"], "");
  const from = element("span", { class: "from" });
  return {
    node: element("div", { class: "preferred" }, pair.node, from),
    draw(latest, saidReason) {
      pair.draw(latest, saidReason);
      setText(from, preferredOrigin(latest));
    },
  };
}
