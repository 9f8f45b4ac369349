/** What the player shows in numbers: when, how fast, how far, and where the shaft is. */

import { amplitudeUnit, shownAmplitude } from "../amplitudes.js";
import { ellipseAt, msAt, spanOf, trailAt } from "../charts/orbit_clip.js";
import { element, setText } from "../dom.js";
import { formatFixed, formatTime } from "../format.js";

const NAMES = ["Time", "Speed", "x, newest turn", "y, newest turn", "1× ellipse", "Shaft centre"];

/** Numbers that change faster than this cannot be read, ms. */
const PERIOD_MS = 250;

const SENSES = { x_to_y: "from x to y", y_to_x: "from y to x", straight: "straight" };

/** Returns `{ node, draw(clip, at, source, how) }`; `how` as for the picture. */
export function orbitFacts() {
  const values = NAMES.map(() => element("dd", {}, "—"));
  const list = element("dl", { class: "facts" }, ...NAMES.map((name, n) => element("div", {}, element("dt", {}, name), values[n])));
  const notes = element("p", { class: "hint" });
  let drawnMs = -Infinity;
  return {
    node: element("div", {}, list, notes),
    draw(clip, at, source, { inClearance, reference }) {
      const nowMs = performance.now();
      if (at.isPlaying && nowMs - drawnMs < PERIOD_MS) return;
      drawnMs = nowMs;
      const words = clip === null ? NAMES.map(() => "—") : wordsOf(clip, at.atS);
      words.forEach((text, n) => setText(values[n], text));
      setText(notes, clip === null ? "" : `${notesOf(clip, source, inClearance)}${referenceWords(reference)}`);
    },
  };
}

function wordsOf(clip, atS) {
  const ms = msAt(clip, atS);
  const turn = trailAt(clip, atS, 1);
  const span = (trace) => {
    const um = spanOf(trace, turn);
    return um === null ? "samples missing" : `${formatFixed(um, 1)} µm pk-pk`;
  };
  return [
    `${formatTime(ms)}.${Math.floor((ms % 1000) / 100)}`,
    clip.speed_rpm === null ? "not known" : `${formatFixed(clip.speed_rpm, 2)} r/min`,
    span(clip.shaft_x_um),
    span(clip.shaft_y_um),
    ellipseWords(clip, atS),
    clip.centre_um === null ? "not known" : `x ${formatFixed(clip.centre_um[0], 1)}, y ${formatFixed(clip.centre_um[1], 1)} µm`,
  ];
}

function ellipseWords(clip, atS) {
  const found = ellipseAt(clip, atS);
  if (found === null) return clip.order1 === null ? "no 1× without a speed" : "too few samples";
  const shown = (um) => formatFixed(shownAmplitude(um), 1);
  return `${shown(found.major)} × ${shown(found.minor)} ${amplitudeUnit()}, ${SENSES[clip.order1.ellipse.sense]}`;
}

function notesOf(clip, source, inClearance) {
  const circle = inClearance ? `Circle: clearance, radius ${formatFixed(clip.clearance_um, 0)} µm. ` : "";
  const marks = clip.mark === null ? "No key-phase here: no mark of a turn on the orbit." : "Dot behind a blank: the key-phase mark passes.";
  const centre = inClearance && clip.centre_um === null ? " The gaps do not tell where the shaft is: the orbit is drawn about the middle." : "";
  const live = source.isLive ? " Live motion is played 3.5 s behind the newest sample; slower or paused, the last 10 s are held." : "";
  return `${circle}Solid: whole motion. Dashed: 1× alone. ${marks}${centre}${live}`;
}

const referenceWords = (reference) =>
  reference === null ? "" : ` Dotted: the reference, the turn up to ${formatTime(msAt(reference.clip, reference.clip.startS + reference.last / reference.clip.rate_hz))}.`;
