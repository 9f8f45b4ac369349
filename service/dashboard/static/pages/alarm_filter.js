/** Which events of the history are wanted, by the condition at which their alarm was raised. */

import { element } from "../dom.js";
import { stateWords } from "../film_words.js";
import { STATES } from "./explorer_state.js";

const RANGES = [
  ["eccentricity", "Eccentricity"],
  ["attitude", "Attitude, °"],
  ["oil_temperature", "Oil, °C"],
];

/** Returns `{ node, query() }`; `onAsk` is called when the filter is submitted. */
export function alarmFilter(onAsk) {
  const options = STATES.map((state) => element("option", { value: state }, stateWords(state)));
  const state = element("select", {}, element("option", { value: "" }, "any state"), ...options);
  const fields = { state };
  const labels = [element("label", {}, "Raised at", state)];
  for (const [name, words] of RANGES) {
    for (const [end, word] of [["min", "from"], ["max", "to"]]) {
      fields[`${name}_${end}`] = element("input", { type: "number", step: "any", placeholder: "any" });
      labels.push(element("label", {}, `${words} ${word}`, fields[`${name}_${end}`]));
    }
  }
  const look = element("button", { type: "submit" }, "Look");
  const clear = element("button", { type: "reset" }, "Clear");
  const node = element("form", { class: "asking", role: "search", "aria-label": "History" }, ...labels, look, clear);
  node.addEventListener("submit", (submitted) => {
    submitted.preventDefault();
    onAsk();
  });
  node.addEventListener("reset", () => setTimeout(onAsk)); // the fields are empty only after the event
  return {
    node,
    query: () => Object.entries(fields).flatMap(([name, { value }]) => (value === "" ? [] : [[name, value]])),
  };
}
