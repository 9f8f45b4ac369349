/** How the stiffness of a film has changed over its newest readings, small: x solid, y dashed. */

import { setAttribute, shape } from "../dom.js";
import { signedPercent } from "../film_words.js";

const [WIDTH, HEIGHT] = [120, 30];
const MIN_RANGE_PERCENT = 5;

/** Returns `{ node, draw(readings) }`; null or no compared reading hides it. The grey line is what is expected. */
export function sparkline() {
  const expected = shape("path", { class: "expected" });
  const lines = ["x", "y"].map((direction) => shape("path", { class: direction }));
  const box = { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "sparkline", preserveAspectRatio: "none", role: "img" };
  const node = shape("svg", box, expected, ...lines);
  return {
    node,
    draw(readings) {
      const columns = ["x", "y"].map((direction) => (readings?.[direction].deviation_percent ?? []).filter((one) => one !== null));
      const all = columns.flat();
      node.toggleAttribute("hidden", all.length === 0);
      if (all.length === 0) return;
      const [low, high] = [Math.min(-MIN_RANGE_PERCENT, ...all), Math.max(MIN_RANGE_PERCENT, ...all)];
      const top = (percent) => (1 + ((high - percent) / (high - low)) * (HEIGHT - 2)).toFixed(1);
      setAttribute(expected, "d", `M0 ${top(0)}H${WIDTH}`);
      columns.forEach((column, n) => setAttribute(lines[n], "d", lineOf(column, top)));
      const now = columns.map((column, n) => `${"xy"[n]} ${column.length ? signedPercent(column.at(-1), 0) : "unknown"}`);
      setAttribute(node, "aria-label", `Change of stiffness over the newest readings, now ${now.join(", ")}`);
    },
  };
}

function lineOf(column, top) {
  const step = WIDTH / Math.max(column.length - 1, 1);
  return column.map((percent, n) => `${n ? "L" : "M"}${(n * step).toFixed(1)} ${top(percent)}`).join("");
}
