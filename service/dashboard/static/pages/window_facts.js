/** What the numbers rest on: the averaged window and the bearing's own constants. */

import { element, setText } from "../dom.js";
import { formatAge, formatCount, formatFixed } from "../format.js";
import { runoutWords } from "../words.js";

const FACTS = [
  ["Segments averaged", (w) => `${w.n_segments} of ${w.n_segments_wanted} wanted`],
  ["Segments lost to gaps", (w) => formatCount(w.n_voided)],
  ["Coverage", (w) => `${formatFixed(w.coverage * 100, 1)} %`],
  ["Length", (w) => formatAge(w.duration_s)],
  ["First sample index", (w) => formatCount(w.first_index)],
  ["Last sample index", (w) => formatCount(w.last_index)],
  ["Epoch of the device", (w) => String(w.epoch)],
];

const RUNOUT = "Runout at 1×";

/** Returns `{ node, draw(latest) }`. */
export function windowFacts() {
  const sentence = element("p", { class: "sentence" });
  const values = FACTS.map(() => element("dd"));
  const rows = FACTS.map(([name], index) => element("div", {}, element("dt", {}, name), values[index]));
  const runout = element("dd");
  rows.push(element("div", {}, element("dt", {}, RUNOUT), runout));
  const list = element("dl", { class: "facts" }, ...rows);
  return {
    node: element("section", { class: "panel window" }, element("h2", {}, "Averaged window"), sentence, list),
    draw(latest) {
      list.hidden = latest.window === null;
      setText(sentence, windowSentence(latest));
      setText(runout, runoutWords(latest.runout));
      if (latest.window) FACTS.forEach(([, words], index) => setText(values[index], words(latest.window)));
    },
  };
}

function windowSentence(latest) {
  if (latest.window === null) return "No segment has been averaged yet, so there is no window to describe.";
  const current = latest.quality.level !== "bad" || latest.readings.order1_frequency_hz?.value != null;
  return current ? "The numbers above are averages over these samples." : "The last window that was averaged.";
}
