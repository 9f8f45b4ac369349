/** How many samples were lost lately, from counts that only say how many were lost since the start. */

import { rejected } from "../source_words.js";

const SPAN_MS = 60_000;

/** Returns `{ of(source) }`: samples missing or rejected in the last minute that this page has seen. */
export function losses() {
  const seen = new Map();
  return {
    of(source) {
      const now = performance.now();
      const count = source.n_gap + rejected(source);
      const earlier = (seen.get(source.unit) ?? []).filter(({ at, total }) => at >= now - SPAN_MS && total <= count);
      seen.set(source.unit, [...earlier, { at: now, total: count }]);
      return earlier.length ? count - earlier[0].total : 0;
    },
  };
}
