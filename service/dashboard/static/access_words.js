/** Accounts and keys in words. */

import { formatTime } from "./format.js";

/** Value and words of each role, from the least to the most. */
export const ROLES = [
  ["viewer", "viewer: sees the plant"],
  ["operator", "operator: acts on alarms"],
  ["engineer", "engineer: changes what is measured"],
  ["admin", "admin: lets people in"],
];

/** Look and words of a key's state; one that soon ends is worth a look. */
export function keyMark({ state, expires }, nowMs) {
  if (state === "revoked") return ["absent", "Revoked"];
  if (state === "expired") return ["absent", "Expired"];
  const daysLeft = (Date.parse(expires) - nowMs) / 86_400_000;
  return daysLeft < 14 ? ["uncertain", `Valid, ends in ${Math.max(1, Math.ceil(daysLeft))} d`] : ["good", "Valid"];
}

export const usedWords = ({ used }) => (used === null ? "never" : formatTime(Date.parse(used)));
export const unitsWords = ({ units }) => (units.length === 0 ? "all" : units.join(", "));

/** Units as typed: `U1, U2`. */
export const unitsOf = (typed) => typed.split(/[\s,;]+/).filter(Boolean);
