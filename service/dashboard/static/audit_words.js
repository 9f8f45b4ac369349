/** Entries of the audit trail in words: what was done, to what, and what has changed by it. */

import { formatTime } from "./format.js";
import { alarmIdWords } from "./recording_words.js";

const SOURCES = { api: "dashboard or API", command_line: "command line", padwatch: "padwatch itself" };

/** `alarm taken out of service` of `alarm.taken_out_of_service`. */
export const actionWords = (action) => action.replace(".", " ").replaceAll("_", " ");

/** What it was done to; alarms are named as on the alarm list. */
export function objectWords({ action, object }) {
  if (action.startsWith("baseline.")) return object.replace(/:(\d+)$/, ", version $1").replaceAll(":", " ");
  if (!action.startsWith("alarm.")) return object;
  const [unit, subject] = object.split(":");
  const words = alarmIdWords(object);
  return ["link", "device"].includes(subject) || words === object ? words : `${unit} ${words}`;
}

/** Actor of an entry. */
export const actorWords = ({ actor }) => actor || "not known";

/** Through what, and from where. */
export const throughWords = ({ source, peer }) => (SOURCES[source] ?? source) + (peer ? `, ${peer}` : "");

/** What has changed, a line for each: `state: unacknowledged → shelved`. What stayed is not said. */
export function changeLines({ before, after }) {
  if (before === null && after === null) return [];
  const names = [...new Set([...Object.keys(before ?? {}), ...Object.keys(after ?? {})])];
  const lines = names.map((name) => changeLine(name, before?.[name], after?.[name], before !== null, after !== null));
  return lines.filter((line) => line !== null);
}

function changeLine(name, old, now, hasBefore, hasAfter) {
  if (JSON.stringify(old) === JSON.stringify(now)) return null;
  const [was, is] = [old, now].map((value) => valueWords(name, value));
  const head = `${nameWords(name)}: `;
  if (!hasBefore || old === undefined) return now === null ? null : head + is;
  return hasAfter ? `${head}${was} → ${is}` : `${head}was ${was}`;
}

const LONGEST = 60;

const nameWords = (name) => name.replace(/_ns$/, "").replaceAll("_", " ");

function valueWords(name, value) {
  if (value === null || value === undefined) return "none";
  if (typeof value === "boolean") return value ? "yes" : "no";
  if (name.endsWith("_ns") && Number.isFinite(Number(value))) return formatTime(Number(value) / 1e6);
  if (Array.isArray(value)) return value.length ? value.map((one) => valueWords("", one)).join(", ") : "none";
  if (typeof value === "object") return Object.entries(value).map(([key, one]) => `${nameWords(key)} ${valueWords(key, one)}`).join(", ");
  const text = String(value);
  if (/^[0-9a-f]{40,}$/.test(text)) return `${text.slice(0, 12)}…`;
  if (/^\d{4}-\d\d-\d\dT[\d:.]+(Z|[+-]\d\d:\d\d)$/.test(text)) return formatTime(Date.parse(text));
  return text.length > LONGEST ? `${text.slice(0, LONGEST)}…` : text.replaceAll("_", " ");
}

/**
 * Whether each entry carries the hash of the one before it in its chain, as far as both are shown:
 * `{ look, words }`. The service's own check reads all of them and computes every hash.
 */
export function chainWords(entries) {
  const newer = new Map();
  const linked = new Set();
  for (const older of entries) {
    const entry = newer.get(older.chain);
    newer.set(older.chain, older);
    if (entry?.number !== older.number + 1) continue;
    linked.add(entry).add(older);
    if (entry.previous_hash !== older.hash) return { look: "bad", words: `Entry ${entry.number} of the chain ${entry.chain} does not carry the hash of entry ${older.number}: run padwatch audit verify.` };
  }
  if (linked.size === 0) return { look: "absent", words: "No two entries shown follow each other. All of them are checked by padwatch audit verify." };
  return { look: "good", words: `${linked.size} entries shown have an intact hash chain. To check all entries: padwatch audit verify.` };
}
