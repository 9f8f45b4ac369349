/** The shaft centre in its clearance circle, small: where it stands, seen from above. */

import { element, setAttribute, setText, shape } from "../dom.js";
import { formatFixed } from "../format.js";
import { reasonWords } from "../words.js";
import { readingOf } from "./reading.js";

const RADIUS = 40;
const NAMES = ["shaft_centre_x_um", "shaft_centre_y_um", "eccentricity_ratio"];

/** Returns `{ node, draw(latest) }`; without a shaft centre there is a sentence instead. */
export function centrePicture() {
  const way = shape("path", { class: "way" });
  const point = shape("circle", { class: "now", r: 5 });
  const cross = shape("path", { class: "middle", d: "M-46 0H46M0 -46V46" });
  const circle = shape("circle", { class: "clearance", r: RADIUS });
  const picture = shape("svg", { class: "centre-picture", viewBox: "-50 -50 100 100", role: "img" }, cross, circle, way, point);
  const none = element("span", { class: "from" });
  return {
    node: element("div", { class: "centre-brief" }, picture, none),
    draw(latest) {
      const readings = NAMES.map((name) => readingOf(latest, name));
      const missing = readings.find(({ value }) => value === null);
      picture.toggleAttribute("hidden", Boolean(missing));
      setText(none, missing ? `No shaft centre: ${reasonWords(missing.reason)}` : "");
      if (missing) return;
      const [left, top] = placeOf(...readings.map(({ value }) => value));
      setAttribute(way, "d", `M0 0L${left} ${top}`);
      setAttribute(point, "cx", left);
      setAttribute(point, "cy", top);
      setAttribute(picture, "aria-label", `Shaft centre at ${formatFixed(readings[2].value, 3)} of the clearance`);
    },
  };
}

/** Of x to the right and y up, as far out as the eccentricity says; beyond the circle still in the picture. */
function placeOf(x, y, eccentricity) {
  const length = Math.hypot(x, y) || 1;
  const reach = Math.min(eccentricity, 1.1) * RADIUS;
  return [(reach * x) / length, (-reach * y) / length].map((part) => part.toFixed(1));
}
