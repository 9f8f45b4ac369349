/** The verdict on a bearing in a line: what is wrong with it, since when, and by how much. */

import { ALARM_KINDS } from "./alarm_kinds.js";
import { kindWords } from "./alarm_words.js";
import { expectedWords, signedPercent, verdictMark } from "./film_words.js";
import { formatTime } from "./format.js";
import { serviceTimeMs } from "./server_time.js";

const CAUSES = {
  film_changed: "cause: film",
  oil_changed: "cause: oil or cooling",
  clearance_changed: "cause: clearance or wear",
  bracket_changed: "cause: bracket",
  transducer_changed: "cause: transducer",
  bracket_or_transducer_changed: "cause: bracket or transducer",
  changed_cause_unknown: "cause unclear",
};

const RANKS = ["danger", "alert", "quiet", "normal"];
const MOST_OTHERS = 2;

/**
 * Look, words, and a few words of the verdict on a bearing: `DANGER since 22:10: film softer, both directions`.
 *
 * `film` is the summary of its film; `alarms` are its open alarms, null if they are not known.
 */
export function bearingVerdict(film, alarms) {
  const active = (alarms ?? []).filter((alarm) => alarm.is_active);
  if (active.length === 0) return filmVerdict(film);
  const look = active.some(({ level }) => level === "danger") ? "danger" : "alert";
  const since = Math.min(...active.filter(({ level }) => level === look).map(({ raised }) => Date.parse(raised)));
  const isFilm = ({ kind }) => ALARM_KINDS[kind]?.rule === "films";
  const others = active.filter((alarm) => !isFilm(alarm)).map(({ kind }) => kindWords(kind).toLowerCase());
  const words = [...active.filter(isFilm).map((alarm) => changeWords(film, alarm)), ...others.slice(0, MOST_OTHERS)];
  if (others.length > MOST_OTHERS) words.push(`${others.length - MOST_OTHERS} more`);
  const brief = `${look.toUpperCase()} since ${sinceWords(since)}`;
  return [look, `${brief}: ${words.join("; ")}`, brief];
}

/** The worse verdict of x and y, without alarms. */
function filmVerdict(film) {
  if (film.why_not !== null) return ["quiet", "Not watched", "not watched"];
  const marks = [film.x, film.y].map((one) => verdictMark(one, film.limits));
  const [look, words] = marks.toSorted(([a], [b]) => RANKS.indexOf(a) - RANKS.indexOf(b))[0];
  return [look, words, words.toLowerCase()];
}

function changeWords(film, { directions, value, condition_reason: reason }) {
  const said = [...directions].map((axis) => {
    const { level, ck_level: damped, ck_change_percent: ck, change_percent: change = value } = film[axis] ?? {};
    if (damped && !level) return [axis, `c/k ${ck < 0 ? "lower" : "higher"}`];
    return [axis, change === null ? "changed" : change < 0 ? "softer" : "stiffer"];
  });
  const [[axis, how]] = said;
  const both = said.every((one) => one[1] === how) ? `film ${how}, both directions` : `film ${said.map((one) => one.join(" ")).join(", ")}`;
  return (said.length === 1 ? `film ${how} in ${axis}` : both) + (CAUSES[reason] ? ` (${CAUSES[reason]})` : "");
}

/** `22:10` of today, else with the date. */
function sinceWords(timeMs) {
  const [time, today] = [timeMs, serviceTimeMs()].map(formatTime);
  return time.slice(0, 10) === today.slice(0, 10) ? time.slice(11, 16) : time.slice(0, 16);
}

/** `expected 0.330 GN/m; confirmed −12 %` of the direction that has changed more; nothing without an alarm level. */
export function confirmedWords(film) {
  const held = [film.x, film.y].filter((one) => one?.level && one.change_percent !== null);
  if (held.length === 0) return "";
  const worst = held.reduce((a, b) => (Math.abs(b.change_percent) > Math.abs(a.change_percent) ? b : a));
  const expected = expectedWords(worst);
  const before = expected && `${worst === film.x ? "x" : "y"} ${expected}; `;
  return `${before}confirmed ${signedPercent(worst.change_percent, 0)}`;
}
