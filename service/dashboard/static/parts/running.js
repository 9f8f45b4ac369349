/** How a unit runs: operating state, speed and power, the same for all its bearings. */

import { element, setText } from "../dom.js";
import { stateWords } from "../film_words.js";
import { formatQuantity, kindOf } from "../format.js";
import { speedOrigin } from "../words.js";
import { readingOf, readingView } from "./reading.js";

const NO_BEARING = { readings: {}, speed_source: null };

/** The first bearing that has a reading has it for all. */
const knowing = (unit, name) => unit.bearings.find((b) => readingOf(b, name).value !== null) ?? unit.bearings[0] ?? NO_BEARING;

/** `full load, settled`; nothing while it is not known. */
export function operatingWords({ operating_state: state, is_settled: isSettled }) {
  return state === null ? "" : `${stateWords(state)}, ${isSettled ? "settled" : "not settled yet"}`;
}

/** `full load, settled; 628.2 MW, 92.3 r/min`; only what is known. */
export function runningWords(unit) {
  const numbers = ["power_mw", "speed_rpm"].map((name) => {
    const { value } = readingOf(knowing(unit, name), name);
    return value === null ? "" : `${formatQuantity(name, value)} ${kindOf(name).unit}`;
  });
  return [operatingWords(unit), numbers.filter(Boolean).join(", ")].filter(Boolean).join("; ");
}

/** Returns `{ node, draw(unit) }`. */
export function runningView() {
  const speed = readingView("speed_rpm", "Speed");
  const from = element("span", { class: "from" });
  const power = readingView("power_mw", "Power");
  return {
    node: element("div", { class: "running" }, speed.node, from, power.node),
    draw(unit) {
      const latest = knowing(unit, "speed_rpm");
      speed.draw(latest, latest.quality?.reason);
      const origin = speedOrigin(latest);
      setText(from, origin && `(${origin})`);
      power.draw(knowing(unit, "power_mw"), latest.quality?.reason);
    },
  };
}
