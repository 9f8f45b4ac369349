/** Time of the service, from its newest answer: the clock of the browser may be wrong. */

import { moment, secondsBetween } from "./live.js";

let newest = null;

/** Note the time in the headers of an answer. */
export function noteTime(headers) {
  const timeMs = Date.parse(headers.get("Padwatch-Time"));
  if (!Number.isNaN(timeMs)) newest = { timeMs, at: moment() };
}

/** Present time of the service in ms since 1970; null before the first answer. */
export function serviceTimeMs() {
  return newest ? newest.timeMs + secondsBetween(newest.at, moment()) * 1000 : null;
}
