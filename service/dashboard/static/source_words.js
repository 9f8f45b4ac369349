/** How a unit's samples arrive, in words: what is wrong, how bad it is, and what to do. */

import { ALARM_KINDS } from "./alarm_kinds.js";
import { kindWords, valueWords } from "./alarm_words.js";
import { formatAge, formatCount, formatFixed } from "./format.js";
import { sourceState } from "./words.js";

/** Older than this many seconds, samples that should arrive all the time do not. */
const QUIET_S = 10;

/** What to do about an alarm about the way of the samples; empty for any other. */
const adviceOn = (kind) => ALARM_KINDS[kind]?.advice ?? "";

/** What to do about a link that does not come about, by what the error says; the first that fits. */
const LINK_ADVICE = [
  [/refused/i, "The computer answers, but nothing listens at that port: start the DAQ’s server, or mend the port in the plant file."],
  [/wrong device/i, "Another device is at this address: look for a swapped cable or address, or mend the identity in the plant file."],
  [/exception \d/i, "The device refuses what is asked: compare the register map in the plant file with its manual (padwatch probe)."],
  [/malformed reply|length is|CRC|expected/i, "Something answers that is not the device expected: look at address, register map and cabling (padwatch probe)."],
  [/bus-off|error-passive/i, "Look at bit rate, wiring and termination of the CAN bus."],
  [/unreachable|no route/i, "The network has no way there: look at switch, cable and IP address."],
  [/no connection within|no reply|timed? ?out|did not answer/i, "Nothing answers: is the DAQ switched on, its cable in, its address right?"],
  [/closed the connection|reset by/i, "The device ended the connection: it may be restarting, or serve another client."],
  [/name or service|name server|name resolution|host ?name|resolve|getaddrinfo/i, "The name of the device is not known: mend host in the plant file, or the name server."],
  [/no such file|permission|could not open/i, "The serial port is not there or not allowed: look at the adapter and at its rights."],
];

const LINK_ADVICE_ELSE = "Look at the device, its cable and its settings in the plant file; padwatch tries again by itself.";

const KINDS = {
  modbus_ring: "Modbus, block ring",
  modbus_fifo: "Modbus, FIFO",
  modbus_polled: "Modbus, polled registers",
  modbus_vector: "Modbus, vectors from a rack",
  can: "CAN",
  simulated: "Simulated in this program",
};

export const sourceKindWords = (kind) => KINDS[kind] ?? kind.replaceAll("_", " ");

/** What happened to samples, three ways. */
export const received = ({ n_stored: stored, n_flagged: flagged }) => stored + flagged;
export const rejected = ({ rejected: byReason }) => Object.values(byReason).reduce((sum, count) => sum + count, 0);

/** `1 200 (0.02 %)`: never 0 % where there is one. */
export function shareWords(count, all) {
  if (count === 0 || all === 0) return formatCount(count);
  const percent = (100 * count) / all;
  return `${formatCount(count)} (${percent < 0.01 ? "< 0.01" : formatFixed(percent, 2)} %)`;
}

/** Counts by reason: `checksum 600, late 50`. */
export function reasonsWords(byReason) {
  return Object.entries(byReason)
    .filter(([, count]) => count > 0)
    .map(([reason, count]) => `${reason.replaceAll("_", " ")} ${formatCount(count)}`)
    .join(", ");
}

/**
 * The worst thing about a source: `{ rank, look, words, advice }`, the lowest rank first.
 *
 * `alarms` are the active ones about its samples, `lost` how many were lost in the last minute.
 */
export function troubleOf(source, alarms, lost) {
  const found = [linkTrouble(source), ...alarms.map(alarmTrouble), lostTrouble(lost)].filter(Boolean);
  found.sort((one, other) => one.rank - other.rank);
  return found[0] ?? { rank: 9, look: "good", words: sourceState(source.state).words, advice: "" };
}

function linkTrouble({ state, reason, data_age_s: ageS }) {
  const { level, words } = sourceState(state);
  if (state === "not_connected") return { rank: 0, look: level, words, advice: linkAdvice(reason) };
  if (state === "connecting") return { rank: 2, look: level, words, advice: "Wait a moment; the first samples have not arrived yet." };
  if (state === "ended") return { rank: 5, look: "absent", words, advice: "" };
  if (state !== "connected") return { rank: 1, look: level, words, advice: "" };
  if (ageS === null || ageS <= QUIET_S) return null;
  return { rank: 1, look: "bad", words: `Connected, but silent for ${formatAge(ageS)}`, advice: "The link stands, yet no samples come: look whether the DAQ still samples." };
}

export function linkAdvice(reason) {
  return LINK_ADVICE.find(([pattern]) => pattern.test(reason ?? ""))?.[1] ?? LINK_ADVICE_ELSE;
}

function alarmTrouble(alarm) {
  const isDanger = alarm.level === "danger";
  const value = valueWords(alarm);
  return {
    rank: isDanger ? 2 : 3,
    look: isDanger ? "bad" : "uncertain",
    words: kindWords(alarm.kind) + (value ? `: ${value}` : ""),
    advice: adviceOn(alarm.kind),
  };
}

function lostTrouble(lost) {
  if (lost === 0) return null;
  return { rank: 4, look: "uncertain", words: `${formatCount(lost)} samples lost in the last minute`, advice: adviceOn("samples_lost") };
}

/** Whether an alarm is active and about the way of a unit's samples. */
export function isAboutSamples(alarm, unit) {
  if (!alarm.is_active || !adviceOn(alarm.kind)) return false;
  return alarm.unit === unit || (alarm.unit === "plant" && alarm.subject === unit);
}

/** Where a device is, of its settings in the plant file. */
export function addressWords({ kind, host, port, device, device_id: id, interface: bus, channel }) {
  if (kind === "simulated") return "none: simulated";
  if (kind === "can") return `${bus} ${channel}`;
  return `${device ?? `${host}:${port}`}, device ${id}`;
}

/** What the device must say of itself before samples are read from it. */
export function identityWords({ kind, identity }) {
  if (!kind.startsWith("modbus")) return "Not asked for";
  if (!identity) return "Not checked: the plant file gives none";
  if (identity.kind === "signature") return `Checked at every connection: registers at ${identity.address}`;
  const said = [identity.vendor, identity.product_code, identity.revision].filter(Boolean).join(" ");
  return `Checked at every connection: ${said}`;
}
