/** Where to look at what an alarm is about: the bearing, its film, the unit, or the source of samples. */

import { ALARM_KINDS } from "./alarm_kinds.js";
import { SOURCES_ADDRESS, bearingAddress, filmAddress, unitAddress } from "./route.js";

const subjectOf = (kind) => ALARM_KINDS[kind]?.subject;

/** The bearing that an alarm is about; null if it is about none. */
export const bearingOf = ({ subject, kind }) => (subjectOf(kind) === "bearing" ? subject : null);

/** Address of the page with the most detail about an alarm. */
export function alarmPlace({ unit, subject, kind }) {
  if (ALARM_KINDS[kind]?.rule === "films") return filmAddress(unit, subject);
  if (subjectOf(kind) === "bearing") return bearingAddress(unit, subject);
  return subjectOf(kind) === "channel" ? unitAddress(unit) : SOURCES_ADDRESS;
}
