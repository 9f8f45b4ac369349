/** Every number of a bearing, in the order an engineer asks for them. */

import { element, setText } from "../dom.js";
import { budgetPanel } from "../parts/budget.js";
import { pairView, readingOf, readingView } from "../parts/reading.js";
import { budgetSpread } from "../parts/spread.js";
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
  ["Orbit roundness, + forward", [["order1_roundness", "vortex_roundness"], ["1×", "vortex"]]],
  ["Oil and power", [["oil_temperature_c", "power_mw"], ["oil", "power"]]],
];
const BROAD_BAND = [
  ["Shaft motion, broad-band", [["overall_shaft_x_um_pp", "overall_shaft_y_um_pp"], ["x", "y"]]],
  ["Bearing velocity, broad-band", [["overall_bearing_x_mm_s_rms", "overall_bearing_y_mm_s_rms"], ["x", "y"]]],
  ["Phase of shaft motion, 1×", [["order1_shaft_x_phase_deg", "order1_shaft_y_phase_deg"], ["x", "y"]]],
  ["Phase of bearing motion, 1×", [["order1_bearing_x_phase_deg", "order1_bearing_y_phase_deg"], ["x", "y"]]],
];
const OPPOSITE = ["opposite_gap_x_um", "opposite_gap_y_um"];
const GROWTH = "gap_growth_um";

/** Returns `{ node, draw(latest), close() }`. */
export function bearingNumbers(path) {
  const budget = budgetPanel(path);
  budget.node.classList.add("panel");
  const small = TILES.map((one) => tile(one, budget));
  const more = [...BROAD_BAND.map((one) => tile(one, budget)), excursionTile()];
  const tiles = [preferredStiffness(budget), ...small, gapsTile(budget), speedTile(), ...more];
  const nodes = [...tiles.map((one) => one.node), budget.node];
  return {
    node: element("section", { class: "tiles", "aria-label": "Numbers" }, ...nodes),
    draw(latest) {
      const { reason } = qualityOf(latest);
      for (const one of tiles) one.draw(latest, reason);
    },
    close: budget.close,
  };
}

function tile([title, [names, labels]], budget) {
  const pair = pairView(names, labels, undefined, (name) => budgetSpread(name, budget));
  return {
    node: element("div", { class: "tile" }, element("h2", {}, title), pair.node),
    draw: pair.draw,
  };
}

/** Two probes for all bearings; their opposites and what only these can tell where they exist. */
function gapsTile(budget) {
  const gaps = pairView(["gap_x_um", "gap_y_um"], ["x", "y"]);
  const opposite = pairView(OPPOSITE, ["−x", "−y"]);
  const growth = readingView(GROWTH, "growth", undefined, budgetSpread(GROWTH, budget));
  const parts = [gaps, opposite, growth];
  const exists = (latest, name) => readingOf(latest, name).reason !== "not_measured";
  return {
    node: element("div", { class: "tile gaps" }, element("h2", {}, "Probe gaps"), ...parts.map((part) => part.node)),
    draw(latest, saidReason) {
      for (const part of parts) part.draw(latest, saidReason);
      opposite.node.hidden = !OPPOSITE.some((name) => exists(latest, name));
      growth.node.hidden = opposite.node.hidden || !exists(latest, GROWTH);
    },
  };
}

/** The farthest that the shaft moves from its mean, in whichever direction. */
function excursionTile() {
  const excursion = readingView("overall_shaft_um_pk", "");
  return { node: element("div", { class: "tile" }, element("h2", {}, "Farthest excursion"), excursion.node), draw: excursion.draw };
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
