/** Films compared with their baselines, in words for people, and how each verdict looks. */

import { formatFixed, stiffnessShown } from "./format.js";
import { reasonSentence } from "./words.js";

const VERDICTS = {
  normal: ["normal", "Normal"],
  alert: ["alert", "Alert"],
  danger: ["danger", "Danger"],
  gathering_evidence: ["quiet", "Gathering evidence"],
  no_baseline: ["quiet", "No baseline"],
  insufficient_excitation: ["quiet", "Weak signal"],
  bad_quality: ["quiet", "Reading doubted"],
  transient: ["quiet", "Not settled"],
  no_reading: ["quiet", "No current reading"],
};

const JUDGED = ["normal", "alert", "danger"];

const WHY = {
  gathering_evidence: () => "Too few readings have been compared with the baseline yet.",
  insufficient_excitation: () => reasonSentence("insufficient_excitation"),
  bad_quality: reasonSentence,
  transient: () => "Films are compared once the unit has settled in one state, and has warmed up.",
};

const REASONS = {
  none_in_force: "No baseline is in force for this bearing.",
  condition_not_learned: "What the film is like under this condition has not been learned.",
  attitude_not_learned: "The cell has been learned, but not with the shaft in this direction from the centre.",
  baseline_changed: "The next reading is the first to be compared with the baseline in force.",
  waiting_for_data: "No reading has been taken since the service started.",
  stale: "The newest reading is too old to tell of now.",
};

const CAUSES = {
  film: "film",
  oil: "oil",
  clearance: "clearance or wear",
  bracket: "bracket",
  transducer: "transducer",
  bracket_or_transducer: "bracket or transducer",
  unknown: "unclear",
};

const STATES = {
  unknown: "state unknown",
  standstill: "standstill",
  run_up: "run-up",
  speed_no_load: "speed, no load",
  part_load: "part load",
  full_load: "full load",
  run_down: "run-down",
};

export const stateWords = (state) => STATES[state] ?? state.replaceAll("_", " ");

/** Look and word of a verdict; a level that is held shows, whether or not it can be judged now. */
export function verdictMark({ verdict, level, deviation_percent: deviation }, { danger_percent: limit }) {
  // the newest reading is beyond the limit of danger, and the mean that is judged is not yet
  if (verdict === "normal" && level === null && Math.abs(deviation ?? 0) > limit) return ["quiet", "Change not confirmed yet"];
  const [look, word] = VERDICTS[verdict] ?? ["quiet", verdict.replaceAll("_", " ")];
  return level === null || verdict === level ? [look, word] : [level, `${word}, ${level} held`];
}

/** Why a film is not judged, as a sentence; nothing if it is. */
export function whyUnjudged({ verdict, reason }) {
  if (JUDGED.includes(verdict)) return "";
  return REASONS[reason] ?? WHY[verdict]?.(reason) ?? reasonSentence(reason);
}

/** `−19.2 %`, with its sign. */
export function signedPercent(percent, decimals = 1) {
  const digits = formatFixed(percent, decimals);
  return `${/^[−]/.test(digits) || Number(digits) === 0 ? "" : "+"}${digits} %`;
}

/** `Now 0.231, expected 0.330 GN/m (−30.0 %).`; nothing without a reading. */
export function nowSentence(film) {
  const { value, unit } = stiffnessShown(film.stiffness_n_per_m, film.stiffness_of_kb);
  if (value === null) return "";
  const now = `Now ${formatFixed(value, 3)}`;
  return film.deviation_percent === null ? `${now} ${unit}.` : `${now}, ${expectedWords(film)} (${signedPercent(film.deviation_percent)}).`;
}

/** `c/k now 27.1, expected 26.5 ms (+2.3 %).`, with its change and cause if it has changed; nothing without a reading. */
export function dampingSentences(damping) {
  const { ck_s: now, expected_s: expected, deviation, level, cause } = damping;
  const value = now === null ? "" : `c/k now ${formatFixed(1000 * now, 1)}`;
  const words = expected === null ? value && `${value} ms.` : `${value}, expected ${formatFixed(1000 * expected, 1)} ms (${signedPercent(deviation.percent)}).`;
  return level === null ? words : [words, changeSentence(damping), causeSentence(cause)].filter(Boolean).join(" ");
}

/** `expected 0.330 GN/m`; nothing where nothing is. */
export function expectedWords({ expected_n_per_m: expected, expected_of_kb: ratio }) {
  const { value, unit } = stiffnessShown(expected, ratio);
  return value === null ? "" : `expected ${formatFixed(value, 3)} ${unit}`;
}

/** `Confirmed −12.4 %, mean over 4 running hours.`; of the past while it cannot be judged. */
export function changeSentence({ change, verdict, level }) {
  if (change === null) return "";
  const mean = `${signedPercent(change.percent)}, mean over ${formatFixed(change.time_scale_h, 0)} running hours`;
  if (!JUDGED.includes(verdict)) return `When it was judged last: ${mean}.`;
  return level === null ? `${mean.replace(", mean", " as a mean")}.` : `Confirmed ${mean}.`;
}

/** A change that is large but no alarm yet: it must be sure, and last. */
export function pendingSentence({ change, verdict }, { alert_percent: limit }) {
  const isPending = verdict === "normal" && change !== null && Math.abs(change.percent) >= limit;
  return isPending ? "Beyond its limit; an alarm once it is sure and has lasted." : "";
}

/** `Limits: alert ±3.5 %, danger ±15 %` */
export const limitWords = ({ alert_percent: alert, danger_percent: danger }) => `Limits: alert ±${trimmed(alert)} %, danger ±${trimmed(danger)} %`;
const trimmed = (number) => String(Number(number.toFixed(1)));

/** `Cause: film, since the shaft moves as …`. */
export function causeSentence(cause) {
  return cause === null ? "" : `Cause: ${CAUSES[cause.cause] ?? cause.cause}; ${cause.reason}.`;
}

/** `Full load, settled; cell: eccentricity 0.35 to 0.40, oil 45.0 to 47.5 °C`. */
export function conditionWords(condition) {
  if (condition === null) return "Condition not known now.";
  const state = stateWords(condition.operating_state);
  const settled = condition.is_settled ? "settled" : "not settled yet";
  const cell = condition.cell ? `cell: ${cellWords(condition.cell)}` : "eccentricity or oil temperature not known";
  return `${state.charAt(0).toUpperCase()}${state.slice(1)}, ${settled}; ${cell}.`;
}

export function cellWords(cell) {
  const eccentricity = `eccentricity ${formatFixed(cell.eccentricity_low, 3)} to ${formatFixed(cell.eccentricity_high, 3)}`;
  return `${eccentricity}, oil ${formatFixed(cell.oil_temperature_low_c, 1)} to ${formatFixed(cell.oil_temperature_high_c, 1)} °C`;
}

/** How far learning has come: `Learning: 12 of 20 days with readings.`, and what became of the newest readings. */
export function learningSentence(baselines) {
  const { learning, in_force: inForce } = baselines;
  return [progressWords(baselines), learning ? recentWords(learning.recent, inForce) : ""].filter(Boolean).join(" ");
}

/** Why few readings of the last days were learned or judged; nothing if most were. */
function recentWords({ days, n_at_speed: atSpeed, n_settled: settled, n_complete: complete, n_judged: judged }, inForce) {
  const readings = `the ${atSpeed} readings at speed in the last ${formatFixed(days, 0)} days`;
  if (atSpeed === 0) return "";
  if (settled === 0) return `Not judged: none of ${readings} was settled. Each run ends before the oil temperature has settled (oil_settling_s, warm_up_s), or the load changes too often (settling_s).`;
  if (complete === 0) return `Not judged: none of ${readings} has stiffness, eccentricity and oil temperature that are good.`;
  if (judged === 0 && inForce !== null) return `None of ${readings} was judged: their conditions have not been learned, or they are too few.`;
  const lost = atSpeed - complete;
  return 2 * lost > atSpeed ? `Of ${readings}, ${atSpeed - settled} were not settled (oil_settling_s, settling_s) and ${settled - complete} lack a number or a condition.` : "";
}

function progressWords({ learning, in_force: inForce, is_frozen: isFrozen, versions, acceptance }) {
  if (learning === null) return "";
  if (isFrozen) return "Frozen: nothing more is learned until it is thawed.";
  if (learning.since === null) return "Learning has not begun: there is no reading yet.";
  if (learning.n_days !== null) {
    return `Learning: ${learning.n_days} of ${learning.n_days_wanted} days with settled readings.`;
  }
  if (inForce === null) return waitingWords(versions, acceptance);
  return learning.is_over ? "The learning period is over; the baseline is final until you start a new one." : "Learned again from time to time until the learning period ends.";
}

function waitingWords(versions, acceptance) {
  const waiting = versions.find(({ status }) => status === "learned");
  if (!waiting) return "No baseline is in force; nothing more can be said of the film.";
  const why = acceptance === "by_engineer" ? "" : " It was not put in force by itself.";
  return `Version ${waiting.version} waits for an engineer to accept it.${why}`;
}
