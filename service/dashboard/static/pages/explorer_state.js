/** What the trend explorer shows, as it stands in the address: to be bookmarked and sent. */

import { queryOf } from "../route.js";

export const MOST_QUANTITIES = 12;
export const MOST_BEARINGS = 8;
export const SPANS = [
  [900, "15 min"],
  [3600, "Hour"],
  [8 * 3600, "8 h"],
  [86400, "Day"],
  [7 * 86400, "Week"],
  [30 * 86400, "Month"],
  [365 * 86400, "Year"],
];

/** What the charts are drawn over, and whether two units share a chart. */
export const FORMS = [
  ["", "Time"],
  ["two", "Time, two axes"],
  ["oil_temperature_c", "Oil temperature"],
  ["eccentricity_ratio", "Eccentricity"],
];

export const isOverTime = ({ form }) => form === "" || form === "two";

export const STATES = ["standstill", "run_up", "speed_no_load", "part_load", "full_load", "run_down", "unknown"];

/** View of an address without parameters. */
const USUAL = ["stiffness_xx_n_per_m", "stiffness_yy_n_per_m"];
const A_DAY_S = 86400;
const MOST_SPAN_S = 10 * 365 * 86400;
const SHORTEST_MS = 10_000;

/** Out of an address; what cannot be read in it is as usual. */
export function stateOf(hash) {
  const query = queryOf(hash);
  const fixed = fixedRange(query);
  const spanS = Number(query.get("last"));
  const form = query.get("over") ?? "";
  return {
    quantities: query.has("q") ? query.getAll("q").filter(Boolean).slice(0, MOST_QUANTITIES) : USUAL,
    bearings: query.getAll("b").map((one) => one.split("/")).filter((parts) => parts.length === 2).slice(0, MOST_BEARINGS),
    spanS: fixed ? null : spanS >= 60 && spanS <= MOST_SPAN_S ? spanS : A_DAY_S,
    ...(fixed ?? { fromMs: null, toMs: null }),
    state: query.get("state") ?? "",
    form: FORMS.some(([name]) => name === form) ? form : "",
  };
}

function fixedRange(query) {
  const [fromMs, toMs] = ["from", "to"].map((name) => Date.parse(query.get(name) ?? ""));
  return fromMs < toMs ? { fromMs, toMs } : null;
}

/** The address of a state; what is not given is as usual. */
export function addressOf({ quantities, bearings, spanS = A_DAY_S, fromMs, toMs, state, form }) {
  const pairs = bearings.map((one) => ["b", one.join("/")]);
  pairs.push(...(quantities.length ? quantities : [""]).map((name) => ["q", name]));
  if (spanS === null) pairs.push(["from", new Date(fromMs).toISOString()], ["to", new Date(toMs).toISOString()]);
  else pairs.push(["last", String(spanS)]);
  if (state) pairs.push(["state", state]);
  if (form) pairs.push(["over", form]);
  return `#/trends?${new URLSearchParams(pairs)}`;
}

/** From when to when, in ms; a span ends now. */
export function rangeOf({ spanS, fromMs, toMs }, nowMs) {
  return spanS === null ? [fromMs, toMs] : [nowMs - spanS * 1000, nowMs];
}

/** A range about its middle, `factor` times as long, moved by a share of its length; never in the future. */
export function changedRange([fromMs, toMs], factor, move, nowMs) {
  const lengthMs = Math.max((toMs - fromMs) * factor, SHORTEST_MS);
  const middleMs = (fromMs + toMs) / 2 + move * (toMs - fromMs);
  const endMs = Math.min(middleMs + lengthMs / 2, Math.max(nowMs, toMs));
  return { spanS: null, fromMs: Math.round(Math.max(endMs - lengthMs, 0)), toMs: Math.round(endMs) };
}
