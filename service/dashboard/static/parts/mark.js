/** A quality mark: shape, colour and words, each sufficient alone. */

import { element, setAttribute, setText, shape } from "../dom.js";

const WORDS = { good: "Good", uncertain: "Uncertain", bad: "Bad" };

const SHAPES = {
  good: () => [shape("circle", { cx: 8, cy: 8, r: 5.5 })],
  uncertain: () => [
    shape("path", { d: "M8 1.5 15 14.5H1Z" }),
    shape("path", { d: "M8 6v4.2M8 11.7v1.2", class: "stroke" }),
  ],
  bad: () => [
    shape("rect", { x: 1.5, y: 1.5, width: 13, height: 13 }),
    shape("path", { d: "M4.5 4.5l7 7m0-7l-7 7", class: "stroke" }),
  ],
};

/** The shape of a level alone, hidden from screen readers: words must stand beside it. */
export function markShape(level) {
  return shape("svg", { class: `shape ${level}`, viewBox: "0 0 16 16", "aria-hidden": "true" }, ...SHAPES[level]());
}

/** Returns `{ node, draw(level, words) }`. */
export function mark() {
  const words = element("span");
  const node = element("span", { class: "mark" }, words);
  return {
    node,
    draw(level, text) {
      if (node.dataset.level !== level) {
        node.querySelector("svg")?.remove();
        node.prepend(markShape(level));
        setAttribute(node, "data-level", level);
      }
      setText(words, text);
    },
  };
}

/** The words beside a mark: the level, and the reason unless all is well. */
export function levelWords(level, reason) {
  return level === "good" ? WORDS.good : `${WORDS[level]}: ${reason}`;
}
