/** Alarms in words for people, and how each of them looks. */

import { ALARM_KINDS } from "./alarm_kinds.js";
import { amplitudeUnit, shownAmplitude } from "./amplitudes.js";
import { signedPercent, stateWords as operationWords } from "./film_words.js";
import { formatFixed, formatTime } from "./format.js";
import { reasonWords } from "./words.js";

const STATES = {
  normal: "Normal",
  unacknowledged: "Not acknowledged",
  acknowledged: "Acknowledged",
  returned_unacknowledged: "Returned, not acknowledged",
  shelved: "Shelved",
  suppressed: "Suppressed by design",
  out_of_service: "Out of service",
};

const CHANGES = {
  raised: "raised",
  escalated: "rose to danger",
  eased: "eased to alert",
  returned: "returned",
  latched: "condition gone, latched",
  reset: "reset",
  acknowledged: "acknowledged",
  shelved: "shelved",
  unshelved: "unshelved",
  suppressed: "suppressed by design",
  unsuppressed: "no longer suppressed",
  taken_out_of_service: "taken out of service",
  returned_to_service: "returned to service",
  commented: "commented",
  condition_unknown: "cannot be evaluated",
  condition_known: "can be evaluated again",
};

const REASONS = {
  above_limit: "above its limit",
  below_limit: "below its limit",
  amplitude_change_only: "length only, no phase",
  amplitude_change_above_limit: "above its limit by length alone, no phase",
  no_reference: "no reference in this operating state",
  no_phase: "the phase is lost",
  film_changed: "the film has changed",
  oil_changed: "oil has changed",
  clearance_changed: "clearance or wear",
  bracket_changed: "bracket has changed",
  transducer_changed: "a transducer has changed",
  bracket_or_transducer_changed: "bracket or transducer has changed",
  changed_cause_unknown: "changed, cause not known",
  given_up: "the store did not take them",
  polarity: "film reads negative: check type, direction and wiring of this transducer and its partner",
  zone_a: "zone A",
  zone_b: "zone B",
  zone_c: "zone C",
  zone_d: "zone D",
  run_up: "unit runs up",
  run_down: "unit runs down",
  speed_no_load: "unit at speed, no load",
  part_load: "unit at part load",
  full_load: "unit at full load",
  restarted: "no data since the restart",
  transient: "unit not settled",
  no_longer_watched: "no longer watched",
  stamp_regressed: "time ran backwards",
  stamp_repeated: "same time again",
  stamp_jumped: "time jumped",
};

const DECIMALS = { 1: 3, "µm 0-pk": 1, "µm pk-pk": 1, "µm": 0, "mm/s rms": 2, "°C": 1, s: 2, ppm: 0, findings: 0 };

/** What is within limits and yet worth a word. */
const WITHIN = {
  zone_a: "Within limits: zone A",
  zone_b: "Within limits: zone B",
  amplitude_change_only: "Within limits by length alone, no phase",
};

export const kindWords = (kind) => ALARM_KINDS[kind]?.label ?? kind.replaceAll("_", " ");
/** `Film stiffness changed, x and y` */
export const whatWords = ({ kind, directions }) => [kindWords(kind), [...(directions ?? "")].join(" and ")].filter(Boolean).join(", ");
export const stateWords = (state) => STATES[state] ?? state.replaceAll("_", " ");
export const changeWords = (change) => CHANGES[change] ?? change.replaceAll("_", " ");

/** A reason in words; what is no code, such as the words of an error, stays as it is. */
export function alarmReasonWords(reason) {
  if (reason === "ok") return "";
  return REASONS[reason] ?? (/^[a-z0-9_]+$/.test(reason) ? reasonWords(reason) : reason);
}

/** Whether something has taken an alarm off the list. */
export const isHidden = ({ state }) => ["shelved", "suppressed", "out_of_service"].includes(state);

/** Where an alarm is about: its channel or bearing; the unit alone where it is about all of it. */
export function placeWords({ unit, subject }) {
  return ["device", "link"].includes(subject) ? unit : `${unit} ${subject}`;
}

/** Look and word of a priority; what has returned is quiet. */
export function levelMark({ level, is_active: active }) {
  if (!active) return ["quiet", "Returned"];
  return level === "danger" ? ["danger", "Danger"] : ["alert", "Alert"];
}

/** Rules whose alarms have the amplitude of a line as value; those of broad-band vibration have not. */
const LINE_AMPLITUDES = ["shaft_order1", "shaft_change", "bearing_change"];

/** `163.2 µm pk, limit 150.0`, `−11.4 %, limit −3.5 %`; nothing where there are no numbers. */
export function valueWords({ kind, value, limit, value_unit: unit }) {
  if (value === null) return "";
  const rule = ALARM_KINDS[kind]?.rule;
  if (rule === "films") return signedPercent(value) + (limit === null ? "" : `, limit ${signedPercent(limit)}`);
  const isLine = LINE_AMPLITUDES.includes(rule);
  const digits = (number) => formatFixed(isLine ? shownAmplitude(number) : number, DECIMALS[unit] ?? 2);
  const shownUnit = isLine ? amplitudeUnit() : (unit ?? "");
  return `${digits(value)} ${shownUnit}${limit === null ? "" : `, limit ${digits(limit)}`}`;
}

/** `full load, eccentricity 0.37, attitude 47°, oil 46.2 °C`: what is known of where it was raised. */
export function raisedWords({ raised_at: at }) {
  if (at === null) return "";
  const known = (words, number, digits, unit) => (number === null ? [] : [`${words} ${formatFixed(number, digits)}${unit}`]);
  return [
    ...(at.operating_state === "unknown" ? [] : [operationWords(at.operating_state)]),
    ...known("eccentricity", at.eccentricity_ratio, 2, ""),
    ...known("attitude", at.attitude_deg, 0, "°"),
    ...known("oil", at.oil_temperature_c, 1, " °C"),
  ].join(", ");
}

/** What an alarm watches, now; what is not known is said to be unknown, never to be well. */
export function conditionWords({ condition, condition_reason: reason, evidence }) {
  if (condition === "unknown") return `Unknown: ${alarmReasonWords(reason)}`;
  if (condition === "within_limits") return WITHIN[reason] ?? "Within limits";
  return `Active: ${alarmReasonWords(reason)}${evidence ? ` (${evidence})` : ""}`;
}

/** What an alarm becomes if its condition lasts; nothing where no delay is running. */
export function waitWords({ kind, waits_for: next }) {
  if (!next) return "";
  const lasting = ALARM_KINDS[kind]?.rule === "films" ? "once it is certain and has lasted" : "if it lasts for its delay";
  return next === "normal" ? `Returns ${lasting}` : `${next === "danger" ? "Danger" : "Eases to alert"} ${lasting}`;
}

/** Who has taken an alarm off the list, why and until when. */
export function holdWords({ shelf, outage, suppressed_by: suppressed }) {
  const words = [];
  if (outage) words.push(`Out of service by ${outage.actor}: ${outage.reason}`);
  if (shelf) words.push(`Shelved by ${shelf.actor} until ${formatTime(Date.parse(shelf.until))}: ${shelf.reason}`);
  if (suppressed) words.push(`By design: ${alarmReasonWords(suppressed)}`);
  return words.join("; ");
}

/** The whole list in a few words, for the head of every page. */
export function countWords(count) {
  if (count === null) return ["uncertain", "Alarms unknown"];
  const { n_active: active, n_danger: danger, n_unacknowledged: unseen, n_unjudged: unjudged } = count;
  const parts = [];
  if (active !== danger) parts.push(`${active} ${active === 1 ? "alarm" : "alarms"}`);
  if (danger) parts.push(`${danger} danger`);
  if (unseen) parts.push(`${unseen} unacknowledged`);
  if (!active && !unseen) parts.push("No alarms");
  if (unjudged) parts.push(`${unjudged} ${unjudged === 1 ? "alarm" : "alarms"} not judged`);
  const look = danger ? "danger" : active ? "alert" : "quiet";
  return [active || unseen || unjudged ? look : "normal", parts.join(", ")];
}
