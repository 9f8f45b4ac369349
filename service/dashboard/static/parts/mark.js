/** A quality mark: shape, colour and words, each sufficient alone. Looks are those of `lookOf`. */

import { element, setAttribute, setText, shape } from "../dom.js";
import { lookOf, reasonWords } from "../words.js";

const WORDS = { good: "Good", absent: "No value", uncertain: "Uncertain", bad: "Bad" };

const SHAPES = {
  good: () => [shape("circle", { cx: 8, cy: 8, r: 5.5 })],
  absent: () => [
    shape("circle", { cx: 8, cy: 8, r: 5.5 }),
    shape("path", { d: "M4.2 11.8l7.6-7.6", class: "stroke" }),
  ],
  uncertain: () => [
    shape("path", { d: "M8 1.5 15 14.5H1Z" }),
    shape("path", { d: "M8 6v4.2M8 11.7v1.2", class: "stroke" }),
  ],
  bad: () => [
    shape("rect", { x: 1.5, y: 1.5, width: 13, height: 13 }),
    shape("path", { d: "M4.5 4.5l7 7m0-7l-7 7", class: "stroke" }),
  ],
};

/** The shape alone, hidden from screen readers: words must stand beside it. */
export function markShape(look) {
  return shape("svg", { class: `shape ${look}`, viewBox: "0 0 16 16", "aria-hidden": "true" }, ...SHAPES[look]());
}

/** Returns `{ node, draw(look, words) }`. */
export function mark() {
  const words = element("span");
  const node = element("span", { class: "mark" }, words);
  return {
    node,
    draw(look, text) {
      if (node.dataset.look !== look) {
        node.querySelector("svg")?.remove();
        node.prepend(markShape(look));
        setAttribute(node, "data-look", look);
      }
      setText(words, text);
    },
  };
}

/**
 * Draw a quality of the API on a mark: its level in a word, and the reason unless all is well.
 *
 * Where a number is missing for the reason that the page's head shouts already, its mark stays quiet.
 */
export function drawQuality(one, { level, reason }, saidReason = null) {
  const look = level === "bad" && reason === saidReason ? "absent" : lookOf(level, reason);
  one.draw(look, look === "good" ? WORDS.good : `${WORDS[look]}: ${reasonWords(reason)}`);
}
