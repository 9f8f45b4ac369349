/** The link to a unit's data acquisition: state, reason, since when, and the age of its data. */

import { element, setText } from "../dom.js";
import { formatAge, formatCount, formatTime } from "../format.js";
import { sourceState } from "../words.js";
import { mark } from "./mark.js";

/** Returns `{ node, draw(source, refreshS) }`. */
export function sourceView() {
  const link = mark();
  const age = element("span", { class: "data-age" });
  const count = element("span", { class: "samples" });
  return {
    node: element("div", { class: "source" }, link.node, age, count),
    draw(source) {
      const { level, words } = sourceState(source.state);
      link.draw(level, sourceSentence(source, words));
      setText(age, ageWords(source.data_age_s));
      age.dataset.current = String(source.state === "connected");
      setText(count, sampleWords(source));
    },
  };
}

function sourceSentence(source, words) {
  const reason = source.reason ? `: ${source.reason}` : "";
  const since = source.since ? `, since ${formatTime(Date.parse(source.since))}` : "";
  return `${words}${reason}${since}`;
}

/** `Data age 4 s`, also where nothing has ever arrived. */
export function ageWords(ageS) {
  return ageS === null ? "Data age — (none yet)" : `Data age ${formatAge(ageS)}`;
}

function sampleWords(source) {
  const rejected = Object.values(source.rejected).reduce((sum, count) => sum + count, 0);
  const extra = [
    source.n_repeated ? `, ${formatCount(source.n_repeated)} repeated` : "",
    source.n_restarts ? `; device restarted ${formatCount(source.n_restarts)}×` : "",
  ];
  return (
    `Samples: ${formatCount(source.n_stored)} stored, ${formatCount(source.n_flagged)} flagged, ` +
    `${formatCount(source.n_gap)} in gaps, ${formatCount(rejected)} rejected${rejectedWords(source.rejected)}${extra.join("")}`
  );
}

function rejectedWords(rejected) {
  const parts = Object.entries(rejected).map(([reason, count]) => `${reason.replaceAll("_", " ")} ${formatCount(count)}`);
  return parts.length ? ` (${parts.join(", ")})` : "";
}
