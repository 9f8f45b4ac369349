/** The ± after a number: half its 95 % interval, as text or as the button that opens its budget. */

import { labelOf } from "../catalogue.js";
import { element, setAttribute, setText } from "../dom.js";
import { formatSpread } from "../format.js";

/** Returns `{ node, draw(reading) }`; hidden while there is no number or no uncertainty. */
export function spreadView(name, node = element("span", { class: "spread" })) {
  node.hidden = true;
  return {
    node,
    draw({ value, uncertainty, name: reported = name }) {
      node.hidden = value === null || !uncertainty;
      if (!node.hidden) setText(node, formatSpread(reported, value, uncertainty));
    },
  };
}

/** The same as a button that shows and hides the budget in `panel`, below the numbers. */
export function budgetSpread(name, panel) {
  const node = element("button", { type: "button", class: "spread", "aria-expanded": "false", "aria-controls": panel.id });
  const spread = spreadView(name, node);
  node.addEventListener("click", () => panel.toggle(name, labelOf(name), node));
  return {
    node,
    draw(reading) {
      spread.draw(reading);
      setAttribute(node, "title", `Uncertainty budget: ${labelOf(name)}`);
    },
  };
}
