/** Which time the trend explorer shows: a span until now, from one moment to another, and steps from there. */

import { button, element, setText } from "../dom.js";
import { formatZone } from "../format.js";
import { choice } from "../parts/choice.js";
import { SPANS, changedRange, rangeOf } from "./explorer_state.js";

const STEPS = [
  ["Zoom in", 0.5, 0],
  ["Zoom out", 2, 0],
  ["Earlier", 1, -0.5],
  ["Later", 1, 0.5],
];

/** Returns `{ node, show(state, serviceMs, canGoBack), tick(serviceMs) }`; `onRange(changes)` takes a new time, `onBack()` the one before. */
export function timeBar(onRange, onBack) {
  let state = null;
  let nowMs = Date.now();
  const box = element("div");
  const [from, to] = ["From", "To"].map((words) => {
    const input = element("input", { type: "datetime-local", step: "1", required: "" });
    const zone = element("span");
    return { input, zone, node: element("label", {}, `${words} `, zone, " ", input) };
  });
  const form = element("form", { class: "asking", "aria-label": "From one moment to another" }, from.node, to.node, element("button", { type: "submit" }, "Show"));
  const wrong = element("p", { class: "action-failure", role: "alert", hidden: "" });
  const complain = (words) => {
    wrong.hidden = words === "";
    setText(wrong, words);
  };
  const go = (factor, move) => onRange(changedRange(rangeOf(state, nowMs), factor, move, nowMs));
  const steps = STEPS.map(([words, factor, move]) => button(words, () => go(factor, move)));
  const back = button("Back", onBack);
  const buttons = element("div", { class: "asking", role: "group", "aria-label": "Change the time" }, ...steps, back);

  form.addEventListener("submit", (submitted) => {
    submitted.preventDefault();
    const [fromMs, toMs] = [from, to].map(({ input }) => new Date(input.value).getTime());
    complain(fromMs < toMs ? "" : "“From” must be before “To”.");
    if (fromMs < toMs) onRange({ spanS: null, fromMs, toMs });
  });

  return {
    node: element("section", { class: "explorer-time", "aria-label": "Time" }, box, form, buttons, wrong),
    show(shown, serviceMs, canGoBack) {
      [state, nowMs] = [shown, serviceMs];
      const last = choice("Last", SPANS, state.spanS, () => onRange({ spanS: last.value(), fromMs: null, toMs: null }));
      const focused = box.contains(document.activeElement);
      box.replaceChildren(last.node);
      if (focused) last.node.querySelector("input:checked")?.focus();
      const range = rangeOf(state, nowMs);
      [from, to].forEach(({ input, zone }, n) => {
        input.value = localSecond(range[n]);
        setText(zone, `(${formatZone(range[n])}; ${new Date(range[n]).toISOString().slice(0, 19)}Z)`);
      });
      back.disabled = !canGoBack;
      complain("");
    },
    /** Follow the present time. */
    tick: (serviceMs) => (nowMs = serviceMs),
  };
}

/** Local time to the second, as an input of a moment takes it. */
export function localSecond(timeMs) {
  const local = new Date(timeMs - new Date(timeMs).getTimezoneOffset() * 60_000);
  return local.toISOString().slice(0, 19);
}
