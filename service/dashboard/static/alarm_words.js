/** Alarms in words for people, and how each of them looks. */

import { formatFixed, formatTime } from "./format.js";
import { reasonWords } from "./words.js";

const KINDS = {
  channel_not_ok: "Channel not OK",
  order1_shaft_x: "Shaft vibration 1×, x",
  order1_shaft_y: "Shaft vibration 1×, y",
  oil_temperature: "Oil temperature",
  stiffness_x: "Film stiffness changed, x",
  stiffness_y: "Film stiffness changed, y",
  clock_offset: "Device clock off",
  clock_drift: "Device clock drifts",
  time_stamps: "Wrong time stamps",
  link_lost: "Link lost",
};

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
  unshelved: "back from the shelf",
  suppressed: "suppressed by design",
  unsuppressed: "no longer suppressed",
  taken_out_of_service: "taken out of service",
  returned_to_service: "returned to service",
  condition_unknown: "condition no longer known",
  condition_known: "condition known again",
};

const REASONS = {
  above_limit: "above its limit",
  restarted: "no data since the restart",
  no_longer_watched: "no longer watched",
  stamp_regressed: "time ran backwards",
  stamp_repeated: "same time again",
  stamp_jumped: "time jumped",
};

const DECIMALS = { 1: 3, "µm 0-pk": 1, "°C": 1, s: 2, ppm: 0 };

export const kindWords = (kind) => KINDS[kind] ?? kind.replaceAll("_", " ");
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
  if (!active) return ["absent", "Returned"];
  return level === "danger" ? ["bad", "Danger"] : ["uncertain", "Alert"];
}

/** `163.2 µm 0-pk, limit 150.0`; nothing where there are no numbers. */
export function valueWords({ value, limit, value_unit: unit }) {
  if (value === null) return "";
  const digits = (number) => formatFixed(number, DECIMALS[unit] ?? 2);
  return `${digits(value)} ${unit ?? ""}${limit === null ? "" : `, limit ${digits(limit)}`}`;
}

/** What an alarm watches, now; what is not known is said to be unknown, never to be well. */
export function conditionWords({ condition, condition_reason: reason }) {
  if (condition === "unknown") return `Unknown: ${alarmReasonWords(reason)}`;
  if (condition === "within_limits") return "Within limits";
  return `Active: ${alarmReasonWords(reason)}`;
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
  if (active) parts.push(`${active} ${active === 1 ? "alarm" : "alarms"}`);
  if (danger) parts.push(`${danger} danger`);
  if (unseen) parts.push(`${unseen} not acknowledged`);
  if (!active && !unseen) parts.push("No alarms");
  if (unjudged) parts.push(`${unjudged} not judged`);
  const look = danger ? "bad" : active ? "uncertain" : "absent";
  return [active || unseen || unjudged ? look : "good", parts.join(", ")];
}
