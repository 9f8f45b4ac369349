/** Readings of a film over a time. */

import { ask } from "./api.js";

/** Readings of the film of a bearing, from `spanS` seconds before `endMs` until then. */
export function askReadings(path, endMs, spanS, maxPoints, signal) {
  const range = [["start", new Date(endMs - spanS * 1000).toISOString()], ["end", new Date(endMs).toISOString()]];
  return ask([...path, "film", "readings"], [...range, ["max_points", String(maxPoints)]], signal);
}
