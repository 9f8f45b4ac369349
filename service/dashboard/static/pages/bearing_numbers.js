/** Every number of a bearing, in the order an engineer asks for them. */

import { element, setText } from "../dom.js";
import { pairView, readingView } from "../parts/reading.js";
import { qualityOf, speedOrigin } from "../words.js";

const PAIRS = (order, what, axes, unit) => [axes.map((axis) => `${order}_${what.replace("*", axis)}`), axes, unit];
const K = (order) => PAIRS(order, "k_eff_*_n_per_m", ["xx", "yy"]);
const SHAFT = (order) => PAIRS(order, "shaft_*_um_pk", ["x", "y"]);
const BRACKET = (order) => PAIRS(order, "bearing_*_um_pk", ["x", "y"]);
const COHERENCE = (order) => PAIRS(order, "coherence_*", ["xx", "yy"]);

const TILES = [
  ["Film stiffness k_eff, 1×", "large", K("order1")],
  ["Film stiffness k_eff, vortex", "large", K("vortex")],
  ["Shaft motion, 1×", "", SHAFT("order1")],
  ["Bearing motion, 1×", "", BRACKET("order1")],
  ["Shaft motion, vortex", "", SHAFT("vortex")],
  ["Bearing motion, vortex", "", BRACKET("vortex")],
  ["Shaft centre", "", [["shaft_centre_x_um", "shaft_centre_y_um"], ["x", "y"]]],
  ["Probe gaps", "", [["gap_x_um", "gap_y_um"], ["x", "y"]]],
  ["Eccentricity and attitude", "", [["eccentricity_ratio", "attitude_angle_deg"], ["ratio", "angle"]]],
  ["Oil and power", "", [["oil_temperature_c", "power_mw"], ["oil", "power"]]],
  ["Coherence, 1×", "", COHERENCE("order1")],
  ["Coherence, vortex", "", COHERENCE("vortex")],
  ["Line frequencies", "", [["order1_frequency_hz", "vortex_frequency_hz"], ["1×", "vortex"]]],
];

/** Returns `{ node, draw(latest) }`. */
export function bearingNumbers() {
  const tiles = [...TILES.map(pairTile), speedTile()];
  return {
    node: element("section", { class: "tiles", "aria-label": "Numbers" }, ...tiles.map((tile) => tile.node)),
    draw(latest) {
      for (const tile of tiles) tile.draw(latest);
    },
  };
}

function pairTile([title, size, [names, labels]]) {
  const pair = pairView(names, labels);
  return {
    node: element("div", { class: `tile ${size}` }, element("h2", {}, title), pair.node),
    draw: (latest) => pair.draw(latest, qualityOf(latest).reason),
  };
}

function speedTile() {
  const speed = readingView("speed_rpm", "");
  const from = element("span", { class: "from" });
  return {
    node: element("div", { class: "tile" }, element("h2", {}, "Speed"), speed.node, from),
    draw(latest) {
      speed.draw(latest, qualityOf(latest).reason);
      setText(from, speedOrigin(latest));
    },
  };
}
