/** Every number of a bearing, in the order an engineer asks for them. */

import { element, setText } from "../dom.js";
import { budgetPanel } from "../parts/budget.js";
import { pairView, readingView } from "../parts/reading.js";
import { qualityOf, speedOrigin } from "../words.js";
import { preferredStiffness } from "./preferred_stiffness.js";

const PAIRS = (order, what, axes, unit) => [axes.map((axis) => `${order}_${what.replace("*", axis)}`), axes, unit];
const SHAFT = (order) => PAIRS(order, "shaft_*_um_pk", ["x", "y"]);
const BRACKET = (order) => PAIRS(order, "bearing_*_um_pk", ["x", "y"]);

const TILES = [
  ["Shaft motion, 1×", SHAFT("order1")],
  ["Bearing motion, 1×", BRACKET("order1")],
  ["Shaft centre", [["shaft_centre_x_um", "shaft_centre_y_um"], ["x", "y"]]],
  ["Shaft motion, vortex", SHAFT("vortex")],
  ["Bearing motion, vortex", BRACKET("vortex")],
  ["Eccentricity and attitude", [["eccentricity_ratio", "attitude_angle_deg"], ["ratio", "angle"]]],
  ["Line frequencies", [["order1_frequency_hz", "vortex_frequency_hz"], ["1×", "vortex"]]],
  ["Probe gaps", [["gap_x_um", "gap_y_um"], ["x", "y"]]],
  ["Oil temperature", [["oil_temperature_c"], [""]]],
  ["Power", [["power_mw"], [""]]],
];

/** Returns `{ node, draw(latest), close() }`. */
export function bearingNumbers(path) {
  const budget = budgetPanel(path);
  budget.node.classList.add("panel");
  const tiles = [preferredStiffness(budget), ...TILES.map(tile), speedTile()];
  const nodes = tiles.map((one) => one.node);
  nodes.splice(1, 0, budget.node); // next in the tab order; shown below all tiles
  return {
    node: element("section", { class: "tiles", "aria-label": "Numbers" }, ...nodes),
    draw(latest) {
      const { reason } = qualityOf(latest);
      for (const one of tiles) one.draw(latest, reason);
    },
    close: budget.close,
  };
}

function tile([title, [names, labels]]) {
  const numbers = names.length === 1 ? readingView(names[0], "") : pairView(names, labels);
  return {
    node: element("div", { class: "tile" }, element("h2", {}, title), numbers.node),
    draw: numbers.draw,
  };
}

function speedTile() {
  const speed = readingView("speed_rpm", "");
  const from = element("span", { class: "from" });
  return {
    node: element("div", { class: "tile" }, element("h2", {}, "Speed"), speed.node, from),
    draw(latest, saidReason) {
      speed.draw(latest, saidReason);
      setText(from, speedOrigin(latest));
    },
  };
}
