/** A stretch of a shaft's motion as it is played, and what is read off it at a moment. */

/** From an answer of the service; its times are those of the recording, or of the device's count. */
export function clipOf(motion) {
  const startS = motion.offset_s ?? motion.first_index / motion.rate_hz;
  return {
    ...motion,
    startS,
    endS: startS + (motion.n_samples - 1) / motion.rate_hz,
    startMs: Date.parse(motion.start),
    turnS: motion.speed_rpm ? 60 / motion.speed_rpm : null,
  };
}

/** Index of the newest sample at a time. */
export function indexAt(clip, atS) {
  return Math.min(Math.max(Math.floor((atS - clip.startS) * clip.rate_hz + 1e-6), 0), clip.n_samples - 1);
}

/** Milliseconds since 1970 of a time of the clip. */
export const msAt = (clip, atS) => clip.startMs + (atS - clip.startS) * 1000;

/** Length of a trail of some turns, s; without a speed, as if each took a second. */
export const trailS = (clip, turns) => turns * (clip.turnS ?? 1);

/** The samples from some turns ago until now: `{ first, last }`, both among them. */
export function trailAt(clip, atS, turns) {
  return { first: indexAt(clip, atS - trailS(clip, turns)), last: indexAt(clip, atS) };
}

/** Marks of the key-phase among some samples, in samples of the clip. */
export function marksIn({ mark }, { first, last }) {
  return (mark ?? []).filter((at) => at >= first && at <= last);
}

/** Peak-to-peak of a trace among some samples; null where one of them is missing. */
export function spanOf(trace, { first, last }) {
  let [low, high] = [Infinity, -Infinity];
  for (let n = first; n <= last; n += 1) {
    if (trace[n] === null) return null;
    low = Math.min(low, trace[n]);
    high = Math.max(high, trace[n]);
  }
  return high - low;
}

/** Half axes of the path at running speed over the newest turn, µm zero-to-peak; null without. */
export function ellipseAt(clip, atS) {
  if (clip.order1 === null) return null;
  const { first, last } = trailAt(clip, atS, 1);
  let [minor, major] = [Infinity, 0];
  for (let n = first; n <= last; n += 1) {
    const [x, y] = [clip.order1.shaft_x_um[n], clip.order1.shaft_y_um[n]];
    if (x === null || y === null) return null;
    const reach = Math.hypot(x, y);
    [minor, major] = [Math.min(minor, reach), Math.max(major, reach)];
  }
  return { minor, major };
}

/** The farthest excursion in the whole clip, so that the picture stands still while it plays. */
export function reachOf(clip) {
  const farthest = (trace) => trace.reduce((far, um) => Math.max(far, Math.abs(um ?? 0)), 0);
  return Math.max(farthest(clip.shaft_x_um), farthest(clip.shaft_y_um), 1);
}
