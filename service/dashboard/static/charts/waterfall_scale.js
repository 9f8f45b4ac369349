/** The scale of amplitudes that a waterfall and its single spectra share. */

import { shownAmplitude } from "../amplitudes.js";

/** Below this, integrated velocity is mostly drift: drawn, but it does not set the scale. */
export const SCALE_FROM_HZ = 0.2;

/** Decades of a logarithmic scale below the largest amplitude. */
export const DECADES = 4;

/** Of the amplitudes of a map, the share below and above which they look alike. */
const CLIP = 0.05;
const CLIP_ABOVE = 0.01;

/** The largest amplitude in sight, as it is shown. */
export const highest = (drawn) => inSight(drawn).reduce((most, um) => Math.max(most, um), shownAmplitude(1e-3));

/** All amplitudes above zero that are in sight, as they are shown. */
function inSight({ rows, abscissa, toUpper, turnHz, axis }) {
  const first = abscissa.findIndex((at) => at >= axis.of(SCALE_FROM_HZ, turnHz));
  const cut = abscissa.findLastIndex((at) => at <= toUpper) + 1;
  return rows.flatMap(({ amplitude }) => (amplitude ?? []).slice(first, cut)).filter((um) => um > 0).map(shownAmplitude);
}

/** `low` and `high` of the scale, and where an amplitude in µm lies on it; null if it lies nowhere. */
export function scaleOf(drawn) {
  const high = place(drawn)(highest(drawn));
  return scale(drawn, drawn.isLog ? high - DECADES : 0, high);
}

/** The same for a map, which would be all of one shade: from the 5th to the 99th percentile. */
export function contrastOf(drawn) {
  const sorted = Float64Array.from(inSight(drawn)).toSorted();
  if (sorted[0] === sorted.at(-1)) return scaleOf(drawn);
  const at = (share) => place(drawn)(sorted[Math.round(share * (sorted.length - 1))]);
  return scale(drawn, at(CLIP), at(1 - CLIP_ABOVE));
}

const place = ({ isLog }) => (isLog ? Math.log10 : (um) => um);

const scale = (drawn, low, high) => ({ low, high, of: (um) => (um > 0 ? place(drawn)(shownAmplitude(um)) : drawn.isLog || um === null ? null : 0) });
