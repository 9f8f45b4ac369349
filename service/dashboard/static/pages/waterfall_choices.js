/** What a waterfall shows: channel, time, scale, axis, picture. */

import { button, element } from "../dom.js";
import { keptChoice } from "../parts/kept_choice.js";

const PLACES = [["shaft_x", "Shaft x"], ["shaft_y", "Shaft y"], ["bearing_x", "Bearing x"], ["bearing_y", "Bearing y"]];
const SPANS = [[3600, "1 h"], [8 * 3600, "8 h"], [86400, "1 d"], [7 * 86400, "7 d"], [30 * 86400, "30 d"], [365 * 86400, "1 y"]];
const SCALES = [["log", "Logarithmic"], ["linear", "Linear"]];
const AXES = [["hz", "Hz"], ["cpm", "cpm"], ["orders", "× speed"]];
const UPPERS = [[2.5, "2.5×"], [6, "6×"], [Infinity, "All"]];
const PICTURES = [["map", "Map"], ["lines", "Lines"]];

/** `ask` is called when other spectra are needed, `show` when those there are to be drawn otherwise. */
export function waterfallChoices(ask, show) {
  let shiftS = 0;
  const renewed = () => {
    shiftS = 0;
    moved();
  };
  const place = keptChoice("channel", "Channel", PLACES, "shaft_x", ask);
  const span = keptChoice("last", "Time", SPANS, 3600, renewed);
  const scale = keptChoice("amplitude", "Amplitude", SCALES, "log", show);
  const axis = keptChoice("axis", "Axis", AXES, "hz", show);
  const upper = keptChoice("to", "Up to", UPPERS, 6, show);
  const picture = keptChoice("picture", "Picture", PICTURES, "map", show);
  const shift = (by) => () => {
    shiftS = Math.max(0, shiftS + by * (span.value() / 2));
    moved();
  };
  function moved() {
    later.disabled = shiftS === 0;
    ask();
  }
  const earlier = button("◂ Earlier", shift(1));
  const later = button("Later ▸", shift(-1), { disabled: "" });
  const walk = element("span", { class: "walk" }, earlier, later);
  return {
    node: element("div", { class: "choices" }, place.node, span.node, walk, picture.node, scale.node, axis.node, upper.node),
    place: place.value,
    range: (nowMs) => ({ startMs: nowMs - (shiftS + span.value()) * 1000, endMs: nowMs - shiftS * 1000 }),
    isLog: () => scale.value() === "log",
    axis: axis.value,
    toOrder: upper.value,
    asLines: () => picture.value() === "lines",
    revision: () => [place, span, scale, axis, upper, picture].map((one) => one.value()).join(" ") + shiftS,
  };
}
