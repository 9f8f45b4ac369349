/** The link to a unit's data acquisition: state, reason, since when, and the age of its data. */

import { element, setText } from "../dom.js";
import { formatAge, formatTime } from "../format.js";
import { sourceState } from "../words.js";
import { mark } from "./mark.js";

/** Returns `{ node, draw(source, refreshS) }`. */
export function sourceView() {
  const link = mark();
  const age = element("span", { class: "data-age" });
  return {
    node: element("div", { class: "source" }, link.node, age),
    draw(source) {
      const { level, words } = sourceState(source.state);
      link.draw(level, sourceSentence(source, words));
      setText(age, source.state === "ended" ? "" : ageWords(source.data_age_s));
      age.dataset.current = String(source.state === "connected");
    },
  };
}

function sourceSentence(source, words) {
  if (source.state === "ended") return `${words} at ${formatTime(Date.parse(source.since))}`;
  const reason = source.reason ? `: ${source.reason}` : "";
  const since = source.since ? `, since ${formatTime(Date.parse(source.since))}` : "";
  return `${words}${reason}${since}`;
}

/** `Data age 4 s`, also where nothing has ever arrived. */
export function ageWords(ageS) {
  return ageS === null ? "Data age — (none yet)" : `Data age ${formatAge(ageS)}`;
}
