/** Recordings in words for people: when, what for, how long, how large. */

import { changeWords, kindWords } from "./alarm_words.js";
import { formatAge, formatFixed, formatTime } from "./format.js";

/** `163 MB`, `4.1 kB`: in steps of a thousand, three digits that count. */
export function sizeWords(nBytes) {
  const steps = ["B", "kB", "MB", "GB", "TB"];
  const step = nBytes < 1 ? 0 : Math.min(Math.floor(Math.log10(nBytes) / 3), steps.length - 1);
  const size = nBytes / 1000 ** step;
  return `${formatFixed(size, step > 0 && size < 10 ? 1 : 0)} ${steps[step]}`;
}

/** When its samples begin; its name where its manifest cannot be read. */
export const recordingTime = ({ start, id }) => (start === null ? id : formatTime(Date.parse(start)));

export const lengthWords = ({ duration_s: duration }) => (duration === null ? "length not known" : formatAge(duration));

/** `UJB: Shaft vibration 1×, x` of `U1:UJB:order1_shaft_x`. */
export function alarmIdWords(id) {
  const [unit, subject, kind] = id.split(":");
  if (kind === undefined) return id;
  return `${["link", "device"].includes(subject) ? unit : subject}: ${kindWords(kind)}`;
}

/** What a recording was made for: the alarm that began it, and how many joined. */
export function occasionWords({ alarms, kind }) {
  if (kind === "continuous") return "All samples";
  if (alarms.length === 0) return "Made for no alarm";
  const [{ alarm, change }, ...others] = alarms;
  const how = change === "raised" ? "" : ` (${changeWords(change)})`;
  return alarmIdWords(alarm) + how + (others.length ? ` and ${others.length} more` : "");
}

/** An alarm whose samples are still being written. */
export const beingMadeWords = ({ alarm, occurrence }) => `Being written: ${alarmIdWords(alarm)}, occurrence ${occurrence}.`;
