/**
 * A mark: shape, colour and words, each sufficient alone.
 *
 * Round shapes are about data, with the looks of `lookOf`; angular ones about the machine, with the
 * looks `danger`, `alert`, `normal`, and `quiet` for all that is none of these.
 */

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
    shape("circle", { cx: 8, cy: 8, r: 6 }),
    shape("path", { d: "M6 6.4a2 2 0 1 1 2.9 1.8q-.9.5-.9 1.5M8 10.9v1.2", class: "stroke" }),
  ],
  bad: () => [
    shape("circle", { cx: 8, cy: 8, r: 7 }),
    shape("path", { d: "M5 5l6 6m0-6l-6 6", class: "stroke" }),
  ],
  danger: () => [
    shape("rect", { x: 1.5, y: 1.5, width: 13, height: 13 }),
    shape("path", { d: "M8 4v5M8 10.6v1.6", class: "stroke" }),
  ],
  alert: () => [
    shape("path", { d: "M8 1.5 15 14.5H1Z" }),
    shape("path", { d: "M8 6v4.2M8 11.7v1.2", class: "stroke" }),
  ],
  normal: () => [shape("path", { d: "M2.5 8.5l3.5 3.5 7.5-8", class: "stroke" })],
  quiet: () => [shape("path", { d: "M3 8h10", class: "stroke" })],
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
export function drawQuality(one, { level, reason, words = reasonWords(reason) }, saidReason = null) {
  const look = level === "bad" && reason === saidReason ? "absent" : lookOf(level, reason);
  one.draw(look, look === "good" ? WORDS.good : `${WORDS[look]}: ${words}`);
}
