/** How often alarms have come lately, in one line. */

import { kindWords } from "../alarm_words.js";
import { element, setText } from "../dom.js";
import { formatFixed } from "../format.js";

/** Returns `{ node, draw(rates), fail(sentence) }`. */
export function ratesLine() {
  const node = element("section", { class: "panel alarm-rates", "aria-label": "Alarm rates" }, "");
  return {
    node,
    draw(rates) {
      setText(node, ratesWords(rates));
    },
    fail(words) {
      setText(node, `How often alarms come is not known: ${words}`);
    },
  };
}

/** `Seven days: 12 alarms, 1.7 a day, at most 3 in ten minutes; ...` */
export function ratesWords({ all, stale, is_complete: complete }) {
  const parts = [
    `${count(all.n_alarms, "alarm")}, ${formatFixed(all.per_day, 1)} a day, ` +
      `${formatFixed(all.per_10_min, 2)} in ten minutes, at most ${all.most_in_10_min}`,
  ];
  const [first] = all.most_frequent;
  if (first) parts.push(`most frequent ${nameOf(first.alarm)} (${formatFixed(100 * first.share, 0)} %)`);
  if (all.n_alarms) parts.push(`${formatFixed(100 * all.share_by_level.danger, 0)} % danger`);
  const chattering = Object.keys(all.chattering).length;
  parts.push(chattering ? `${chattering} chattering` : "none chattering");
  parts.push(`${all.n_fleeting} fleeting`);
  parts.push(stale.length ? `${stale.length} standing for more than a day` : "none standing for more than a day");
  return `${complete ? "Seven days" : "Lately (too many to count seven days)"}: ${parts.join("; ")}.`;
}

function nameOf(alarm) {
  const [unit, subject, kind] = alarm.split(":");
  return `${unit} ${subject}: ${kindWords(kind)}`;
}

const count = (n, word) => `${n} ${word}${n === 1 ? "" : "s"}`;
