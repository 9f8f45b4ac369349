/**
 * Amplitudes of lines as people want to read them: zero-to-peak, or peak-to-peak, which is twice that.
 *
 * Only for the eye: the API gives and takes zero-to-peak. Broad-band vibration is no sine, so that its
 * peak-to-peak value is not twice its farthest excursion; those two keep the unit they were measured in.
 */

import { keep, kept } from "./kept.js";

const KEY = "padwatch-amplitudes";
const CHANGED = "padwatch-amplitudes";

/** Value and words of each choice; the first is what a new browser shows. */
export const AMPLITUDES = [["pk", "0 to peak"], ["pp", "peak to peak"]];

const UNITS = { pk: "µm pk", pp: "µm pk-pk" };
const FACTORS = { pk: 1, pp: 2 };

let chosen = kept(KEY, AMPLITUDES.map(([value]) => value));

/** What is chosen: `pk` or `pp`. */
export const amplitudes = () => chosen;

/** The unit to write behind an amplitude of a line. */
export const amplitudeUnit = () => UNITS[chosen];

/** What to multiply zero-to-peak with before it is shown. */
export const amplitudeFactor = () => FACTORS[chosen];

/** An amplitude of a line as it is shown; null stays null. */
export const shownAmplitude = (umPk) => (umPk === null ? null : umPk * amplitudeFactor());

/** Choose, remember, and tell every page. */
export function chooseAmplitudes(choice) {
  chosen = choice;
  keep(KEY, choice);
  window.dispatchEvent(new Event(CHANGED));
}

/** Call `redraw` after every change. */
export const onAmplitudes = (redraw) => window.addEventListener(CHANGED, redraw);
