/** Every number of a bearing, in the order an engineer asks for them. */

import { element } from "../dom.js";
import { budgetPanel } from "../parts/budget.js";
import { pairView, readingOf, readingView } from "../parts/reading.js";
import { budgetSpread } from "../parts/spread.js";
import { qualityOf } from "../words.js";
import { preferredStiffness } from "./preferred_stiffness.js";

const PAIRS = (order, what, axes, unit) => [axes.map((axis) => `${order}_${what.replace("*", axis)}`), axes, unit];
const SHAFT = (order) => PAIRS(order, "shaft_*_um_pk", ["x", "y"]);
const BRACKET = (order) => PAIRS(order, "bearing_*_um_pk", ["x", "y"]);

const KEY = [
  ["Shaft vibration, 1×", SHAFT("order1")],
  ["Bearing vibration, 1×", BRACKET("order1")],
  ["Eccentricity ratio, attitude angle", [["eccentricity_ratio", "attitude_angle_deg"], ["ratio", "angle"]]],
  ["Operation", [["oil_temperature_c", "power_mw", "speed_rpm"], ["oil", "power", "speed"]]],
];
const MORE = [
  ["Shaft centre", [["shaft_centre_x_um", "shaft_centre_y_um"], ["x", "y"]]],
  ["Frequency and orbit shape, 1×", [["order1_frequency_hz", "order1_roundness"], ["", "shape"]]],
  ["Shaft vibration, vortex", SHAFT("vortex")],
  ["Bearing vibration, vortex", BRACKET("vortex")],
  ["Frequency and orbit shape, vortex", [["vortex_frequency_hz", "vortex_roundness"], ["", "shape"]]],
  ["Shaft vibration, broad-band", [["overall_shaft_x_um_pp", "overall_shaft_y_um_pp"], ["x", "y"]]],
  ["Bearing velocity, broad-band", [["overall_bearing_x_mm_s_rms", "overall_bearing_y_mm_s_rms"], ["x", "y"]]],
  ["Maximum shaft displacement", [["overall_shaft_um_pk"], [""]]],
  ["Phase of shaft vibration, 1×", [["order1_shaft_x_phase_deg", "order1_shaft_y_phase_deg"], ["x", "y"]]],
  ["Phase of bearing vibration, 1×", [["order1_bearing_x_phase_deg", "order1_bearing_y_phase_deg"], ["x", "y"]]],
];

/** What does not exist here is left out: a vortex at full load, phases without a key-phase. */
const LEFT_OUT = ["no_vortex", "not_measured", "switched_off"];
const OPPOSITE = ["opposite_gap_x_um", "opposite_gap_y_um"];
const GROWTH = "gap_growth_um";

/** Stiffness and condition. Returns `{ node, draw(latest), close() }`. */
export function keyNumbers(path) {
  return numbers(path, "tiles", (budget) => [preferredStiffness(budget), ...KEY.map((one) => tile(one, budget))]);
}

/** The other numbers. Returns `{ node, draw(latest), close() }`. */
export function moreNumbers(path) {
  return numbers(path, "more-tiles", (budget) => [...MORE.map((one) => tile(one, budget)), gapsTile(budget)]);
}

function numbers(path, style, tilesOf) {
  const budget = budgetPanel(path);
  budget.node.classList.add("panel");
  const tiles = tilesOf(budget);
  return {
    node: element("section", { class: style, "aria-label": "Numbers" }, ...tiles.map((one) => one.node), budget.node),
    draw(latest) {
      const { reason } = qualityOf(latest);
      for (const one of tiles) one.draw(latest, reason);
    },
    close: budget.close,
  };
}

function tile([title, [names, labels]], budget) {
  const pair = pairView(names, labels, undefined, (name) => budgetSpread(name, budget));
  const node = element("div", { class: "tile" }, element("h2", {}, title), pair.node);
  return {
    node,
    draw(latest, saidReason) {
      pair.draw(latest, saidReason);
      node.hidden = names.every((name) => readingOf(latest, name).value === null && LEFT_OUT.includes(readingOf(latest, name).reason));
    },
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
