/** The scale of amplitudes that a waterfall and its single spectra share. */

import { shownAmplitude } from "../amplitudes.js";

/** Below this, integrated velocity is mostly drift: drawn, but it does not set the scale. */
const SCALE_FROM_HZ = 0.2;

/** Decades of a logarithmic scale below the largest amplitude. */
export const DECADES = 4;

/** The largest amplitude in sight, as it is shown. */
export function highest({ rows, abscissa, toUpper, turnHz, inOrders }) {
  const from = SCALE_FROM_HZ / (inOrders ? turnHz : 1);
  const first = abscissa.findIndex((at) => at >= from);
  const cut = abscissa.findLastIndex((at) => at <= toUpper) + 1;
  const of = ({ amplitude }) => (amplitude ? amplitude.slice(first, cut).reduce((a, b) => Math.max(a, b ?? 0), 0) : 0);
  return shownAmplitude(rows.map(of).reduce((a, b) => Math.max(a, b), 1e-3));
}

/** `low` and `high` of the scale, and where an amplitude in µm lies on it; null if it lies nowhere. */
export function scaleOf(drawn) {
  const top = highest(drawn);
  if (!drawn.isLog) return { low: 0, high: top, of: (um) => (um === null ? null : shownAmplitude(um)) };
  const high = Math.log10(top);
  return { low: high - DECADES, high, of: (um) => (um > 0 ? Math.log10(shownAmplitude(um)) : null) };
}
