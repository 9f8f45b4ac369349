/** Which alarms and events are wanted, by what they are and by the condition at which they were raised, and in which order. */

import { kindWords, placeWords, whatWords } from "../alarm_words.js";
import { ALARM_KINDS } from "../alarm_kinds.js";
import { element } from "../dom.js";
import { stateWords } from "../film_words.js";
import { STATES } from "./explorer_state.js";

const RANGES = [
  ["eccentricity", "Eccentricity"],
  ["attitude", "Attitude, °"],
  ["oil_temperature", "Oil, °C"],
];

const ORDERS = {
  urgent: ["most urgent first", () => 0],
  newest: ["newest first", (one, other) => (other.raised ?? "").localeCompare(one.raised ?? "")],
  place: ["by place", (one, other) => placeWords(one).localeCompare(placeWords(other))],
  kind: ["by kind", (one, other) => whatWords(one).localeCompare(whatWords(other))],
};

/** Returns `{ node, query(), eventQuery(), sorted(alarms), toCell(alarm) }`; `onAsk` is called after a change. */
export function alarmFilter(onAsk) {
  const fields = {
    place: element("input", { placeholder: "U1, or U1 UJB", size: "10" }),
    kind: choice(Object.keys(ALARM_KINDS).map((kind) => [kind, kindWords(kind)])),
    level: choice([["alert", "alert"], ["danger", "danger"]]),
    acknowledged: choice([["false", "not acknowledged"], ["true", "acknowledged"]]),
    state: choice(STATES.map((state) => [state, stateWords(state)])),
  };
  const heads = { place: "Where", kind: "What", level: "Priority", acknowledged: "Seen", state: "Raised at" };
  const labels = Object.entries(heads).map(([name, words]) => element("label", {}, words, fields[name]));
  for (const [name, words] of RANGES) {
    for (const [end, word] of [["min", "from"], ["max", "to"]]) {
      fields[`${name}_${end}`] = element("input", { type: "number", step: "any", placeholder: "any" });
      labels.push(element("label", {}, `${words} ${word}`, fields[`${name}_${end}`]));
    }
  }
  const order = element("select", {}, ...Object.entries(ORDERS).map(([value, [words]]) => element("option", { value }, words)));
  const look = element("button", { type: "submit" }, "Filter");
  const clear = element("button", { type: "reset" }, "Clear");
  const form = element("form", { class: "asking", role: "search", "aria-label": "Alarms and history" }, ...labels, element("label", {}, "Order", order), look, clear);
  const node = element("details", { class: "panel alarm-filter" }, element("summary", {}, "Filter and order"), form);
  form.addEventListener("submit", (submitted) => {
    submitted.preventDefault();
    onAsk();
  });
  order.addEventListener("change", onAsk);
  form.addEventListener("reset", () => setTimeout(onAsk)); // the fields are empty only after the event

  function query() {
    const { place, ...others } = fields;
    const [unit, subject] = place.value.trim().split(/\s+/);
    const given = [["unit", unit], ["subject", subject ?? ""], ...Object.entries(others).map(([name, { value }]) => [name, value])];
    return given.filter(([, value]) => value !== "");
  }
  return {
    node,
    query,
    eventQuery: () => query().filter(([name]) => name !== "acknowledged"),
    sorted: (alarms) => [...alarms].sort(ORDERS[order.value][1]),
    toCell({ raised_at: { operating_state: state, cell } }) {
      form.reset();
      const bounds = {
        state,
        eccentricity_min: cell.eccentricity_low,
        eccentricity_max: cell.eccentricity_high,
        oil_temperature_min: cell.oil_temperature_low_c,
        oil_temperature_max: cell.oil_temperature_high_c,
        attitude_min: cell.attitude_low_deg ?? "",
        attitude_max: cell.attitude_high_deg ?? "",
      };
      for (const [name, value] of Object.entries(bounds)) fields[name].value = value;
      node.open = true;
    },
  };
}

const choice = (options) => element("select", {}, element("option", { value: "" }, "any"), ...options.map(([value, words]) => element("option", { value }, words)));
