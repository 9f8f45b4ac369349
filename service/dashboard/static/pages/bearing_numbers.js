/** Every number of a bearing, in the order an engineer asks for them. */

import { labelOf } from "../catalogue.js";
import { element } from "../dom.js";
import { budgetPanel } from "../parts/budget.js";
import { pairView, readingOf } from "../parts/reading.js";
import { budgetSpread } from "../parts/spread.js";
import { qualityOf } from "../words.js";

const PAIR = (place) => [["x", "y"].map((axis) => `${place}_${axis}_um_pk`), ["x", "y"]];

const KEY = [
  ["Film stiffness ± 95 %", [["stiffness_xx_n_per_m", "stiffness_yy_n_per_m"], ["xx", "yy"]]],
  ["Shaft vibration, 1×", PAIR("order1_shaft")],
  ["Bearing vibration, 1×", PAIR("order1_bearing")],
  ["Eccentricity ratio, attitude angle", [["eccentricity_ratio", "attitude_angle_deg"], ["ratio", "angle"]]],
  ["Operation", [["oil_temperature_c", "power_mw", "speed_rpm"], ["oil", "power", "speed"]]],
];
const MORE = [
  ["Probe gaps", [["gap_x_um", "gap_y_um"], ["x", "y"]]],
  ["Probe gaps across the shaft", [["opposite_gap_x_um", "opposite_gap_y_um"], ["−x", "−y"]]],
  ["Thermal growth of all gaps", [["gap_growth_um"], [""]]],
  ["Shaft centre", [["shaft_centre_x_um", "shaft_centre_y_um"], ["x", "y"]]],
  ["Frequency and orbit shape, 1×", [["order1_frequency_hz", "order1_roundness"], ["", "shape"]]],
  ["Shaft vibration, vortex", PAIR("vortex_shaft")],
  ["Bearing vibration, vortex", PAIR("vortex_bearing")],
  ["Frequency and orbit shape, vortex", [["vortex_frequency_hz", "vortex_roundness"], ["", "shape"]]],
  ["Shaft vibration, broad-band", [["overall_shaft_x_um_pp", "overall_shaft_y_um_pp"], ["x", "y"]]],
  ["Bearing velocity, broad-band", [["overall_bearing_x_mm_s_rms", "overall_bearing_y_mm_s_rms"], ["x", "y"]]],
  ["Maximum shaft displacement", [["overall_shaft_um_pk"], [""]]],
  ["Pad temperatures: mean, hottest above it, vector", [["pad_temperature_mean_c", "pad_temperature_excess_k", "pad_temperature_vector_k", "pad_temperature_direction_deg"], ["mean", "hottest", "vector", "towards"]]],
  ["Phase of shaft vibration, 1×", [["order1_shaft_x_phase_deg", "order1_shaft_y_phase_deg"], ["x", "y"]]],
  ["Phase of bearing vibration, 1×", [["order1_bearing_x_phase_deg", "order1_bearing_y_phase_deg"], ["x", "y"]]],
];

/** Slow quantities at the positions that the plant file records; the oil and the pattern of the pads have tiles above. */
const SLOW = /^(?!oil_temperature|pad_temperature_(mean|excess|vector|direction)_)(\w+_temperature_|head_|gate_opening_|excitation_)/;

/** What does not exist here is left out: a vortex at full load, phases without a key-phase. */
const LEFT_OUT = ["no_vortex", "not_measured", "switched_off"];

/** Stiffness and condition. Returns `{ node, draw(latest), close() }`. */
export function keyNumbers(path) {
  return numbers(path, "tiles", KEY);
}

/** The other numbers, and the recorded slow quantities. Returns `{ node, draw(latest), close() }`. */
export function moreNumbers(path) {
  const fixed = numbers(path, "more-tiles", MORE);
  const recorded = new Map();
  return {
    ...fixed,
    draw(latest) {
      fixed.draw(latest);
      for (const name of Object.keys(latest.readings).filter((one) => SLOW.test(one) && !recorded.has(one))) {
        recorded.set(name, tile([labelOf(name), [[name], [""]]], { id: "" }));
        fixed.node.append(recorded.get(name).node);
      }
      for (const one of recorded.values()) one.draw(latest, qualityOf(latest).reason);
    },
  };
}

function numbers(path, style, shown) {
  const budget = budgetPanel(path);
  budget.node.classList.add("panel");
  const tiles = shown.map((one) => tile(one, budget));
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
