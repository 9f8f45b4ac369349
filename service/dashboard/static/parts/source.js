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
  const clock = element("span", { class: "device-clock" });
  return {
    node: element("div", { class: "source" }, link.node, age, count, clock),
    draw(source) {
      const { level, words } = sourceState(source.state);
      link.draw(level, sourceSentence(source, words));
      setText(age, source.state === "ended" ? "" : ageWords(source.data_age_s));
      age.dataset.current = String(source.state === "connected");
      setText(count, source.n_stored === undefined ? "" : sampleWords(source));
      setText(clock, clockWords(source.clock));
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

/** `Device clock +0.120 s, drift −3.1 ± 0.4 ppm`; nothing where there is no such clock. */
function clockWords(clock) {
  if (!clock) return "";
  const parts = [];
  if (clock.offset_s !== null) parts.push(`${signed(clock.offset_s, 3)} s`);
  if (clock.drift_ppm !== null) {
    parts.push(`drift ${signed(clock.drift_ppm, 1)} ± ${(1.96 * clock.drift_uncertainty_ppm).toFixed(1)} ppm`);
  }
  if (clock.n_stamp_faults) parts.push(`${formatCount(clock.n_stamp_faults)} wrong time stamps`);
  return parts.length ? `Device clock ${parts.join(", ")}` : "";
}

function signed(value, digits) {
  return `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(digits)}`;
}
