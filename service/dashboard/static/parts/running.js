/** How a unit runs: operating state, speed and power, the same for all its bearings. */

import { stateWords } from "../film_words.js";
import { formatQuantity, kindOf } from "../format.js";
import { readingOf } from "./reading.js";

const NO_BEARING = { readings: {} };

/** The first bearing that has a reading has it for all. */
const knowing = (unit, name) => unit.bearings.find((b) => readingOf(b, name).value !== null) ?? unit.bearings[0] ?? NO_BEARING;

/** `full load` or `full load, not settled yet`; nothing while it is not known. */
function operatingWords({ operating_state: state, is_settled: isSettled }) {
  return state === null ? "" : stateWords(state) + (isSettled ? "" : ", not settled yet");
}

/** `full load; 628.2 MW, 92.3 r/min, 118.0 m, 81.2 %`; only what is known. */
export function runningWords(unit) {
  const numbers = ["power_mw", "speed_rpm", "head_m", "gate_opening_percent"].map((name) => {
    const { value } = readingOf(knowing(unit, name), name);
    return value === null ? "" : `${formatQuantity(name, value)} ${kindOf(name).unit}`;
  });
  return [operatingWords(unit), numbers.filter(Boolean).join(", ")].filter(Boolean).join("; ");
}
