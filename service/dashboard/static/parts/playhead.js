/**
 * Where a player stands in a clip, as a value; every change makes a new one.
 *
 * `atS` is a time of the clip's own, from `startS` to `endS`; `speed` is in seconds of the machine per
 * second at the screen.
 */

export const STOPPED = { atS: 0, isPlaying: false, speed: 1 };

/**
 * Go on for some seconds at the screen; at the end of the clip wait there, or begin anew if it `loops`.
 * Outside the clip stand still: the piece that belongs there is on its way.
 */
export function advanced(head, elapsedS, { startS, endS }, loops) {
  if (!head.isPlaying || head.atS < startS || head.atS > endS) return head;
  const wanted = head.atS + elapsedS * head.speed;
  if (wanted <= endS) return { ...head, atS: wanted };
  return { ...head, atS: loops ? startS + ((wanted - startS) % Math.max(endS - startS, 1e-3)) : endS };
}

/** Stand at a time, within the clip. */
export function moved(head, toS, { startS, endS }) {
  return { ...head, atS: Math.min(Math.max(toS, startS), endS) };
}
