/** Speed and power of a unit: the same for all its bearings, so the first that has them speaks. */

import { element, setText } from "../dom.js";
import { speedOrigin } from "../words.js";
import { readingOf, readingView } from "./reading.js";

const NO_BEARING = { readings: {}, speed_source: null };

/** Returns `{ node, draw(unit) }`. */
export function runningView() {
  const speed = readingView("speed_rpm", "Speed");
  const from = element("span", { class: "from" });
  const power = readingView("power_mw", "Power");
  return {
    node: element("div", { class: "running" }, speed.node, from, power.node),
    draw(unit) {
      const knowing = (name) => unit.bearings.find((b) => readingOf(b, name).value !== null) ?? unit.bearings[0] ?? NO_BEARING;
      const latest = knowing("speed_rpm");
      speed.draw(latest, latest.quality?.reason);
      const origin = speedOrigin(latest);
      setText(from, origin && `(${origin})`);
      power.draw(knowing("power_mw"), latest.quality?.reason);
    },
  };
}
