/** How often alarms have come lately, in one line. */

import { kindWords } from "../alarm_words.js";
import { element, setText } from "../dom.js";
import { formatFixed } from "../format.js";

/** Returns `{ node, draw(rates), fail(sentence) }`. */
export function ratesLine() {
  const node = element("section", { class: "panel alarm-rates", "aria-label": "Alarm rates" }, "");
  return {
    node,
    draw: (rates) => setText(node, ratesWords(rates)),
    fail: (words) => setText(node, `How often alarms come is not known: ${words}`),
  };
}

/** `Last 7 days: 2 alarms (0.3/day, peak 2 per 10 min). Chattering 0, fleeting 0, stale 0.` */
export function ratesWords({ all, stale, is_complete: complete }) {
  const [first] = all.most_frequent;
  const often = first ? ` Most frequent: ${nameOf(first.alarm)} (${formatFixed(100 * first.share, 0)} %).` : "";
  return (
    `${complete ? "Last 7 days" : "Lately (too many to count 7 days)"}: ${all.n_alarms} ${all.n_alarms === 1 ? "alarm" : "alarms"} ` +
    `(${formatFixed(all.per_day, 1)}/day, peak ${all.most_in_10_min} per 10 min). ` +
    `Chattering ${Object.keys(all.chattering).length}, fleeting ${all.n_fleeting}, stale ${stale.length}.${often}`
  );
}

function nameOf(alarm) {
  const [unit, subject, kind] = alarm.split(":");
  return `${unit} ${subject}: ${kindWords(kind)}`;
}
