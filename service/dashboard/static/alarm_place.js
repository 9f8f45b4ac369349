/** Where to look at what an alarm is about: the bearing, its film, the unit, or the source of samples. */

import { SOURCES_ADDRESS, bearingAddress, filmAddress, unitAddress } from "./route.js";

const OF_A_FILM = /^stiffness_/;
const OF_A_BEARING = /^(order1|overall|zone|gap|opposite_gap|eccentricity|oil_temperature)/;

/** The bearing that an alarm is about; null if it is about none. */
export const bearingOf = ({ subject, kind }) => (OF_A_FILM.test(kind) || OF_A_BEARING.test(kind) ? subject : null);

/** Address of the page that tells most about an alarm. */
export function alarmPlace({ unit, subject, kind }) {
  if (OF_A_FILM.test(kind)) return filmAddress(unit, subject);
  if (OF_A_BEARING.test(kind)) return bearingAddress(unit, subject);
  return kind === "channel_not_ok" ? unitAddress(unit) : SOURCES_ADDRESS;
}
