/** One spectrum by itself: of a channel at a moment, or the full one of a pair. */

import { amplitudeUnit, shownAmplitude } from "../amplitudes.js";
import { stateWords } from "../film_words.js";
import { formatFixed, formatTime } from "../format.js";
import { reasonWords } from "../words.js";
import { HARMONICS } from "./spectrum_reading.js";
import { INK, MARK, X_COLOUR, axis, baseLayout } from "./style.js";
import { DECADES } from "./waterfall_scale.js";

export function momentTraces({ row, frequencyHz, axis }) {
  return [lineOf(frequencyHz.map((hz) => axis.of(hz, row.order1Hz)), row.amplitude, axis.unit)];
}

/** A pair of channels turned into circles: forward to the right of zero, backward to the left. */
export function fullTraces({ full, frequency_hz: frequencyHz, lines }, place, axis) {
  const x = frequencyHz.map((hz) => axis.of(hz, lines.order1));
  const { forward, backward } = full[place];
  return [lineOf([...x.map((at) => -at).reverse(), ...x], [...backward.toReversed(), ...forward], axis.unit)];
}

function lineOf(x, amplitude, unit) {
  const hovertemplate = `%{y:.3~g} ${amplitudeUnit()} at %{x:.4~g} ${unit}<extra></extra>`;
  return { type: "scatter", mode: "lines", x, y: amplitude.map(shownAmplitude), line: { color: X_COLOUR, width: 1.4 }, hovertemplate };
}

/** `top` is the largest amplitude of all, so that one spectrum can be held against the next; the cursor may be null. */
export function momentLayout({ row, axis: along, toUpper, isLog, revision, top }, cursorHz, isFull = false) {
  const at = (hz) => along.of(hz, row.order1Hz);
  const cursor = cursorHz === null ? [] : Array.from({ length: HARMONICS }, (_, n) => (n + 1) * cursorHz);
  const lines = [["1×", row.order1Hz], ["vortex", row.vortexHz]].filter(([, hz]) => hz && row.order1Hz);
  const range = isLog ? [Math.log10(top) - DECADES, Math.log10(top) + 0.1] : [0, 1.1 * top];
  return baseLayout(revision, {
    xaxis: axis(isFull ? `◂ backward, ${along.unit}, forward ▸` : along.title, { range: [isFull ? -toUpper : 0, toUpper] }),
    yaxis: axis(amplitudeUnit(), { type: isLog ? "log" : "linear", range }),
    shapes: [...lines.map(([, hz]) => marker(at(hz))), ...cursor.map((hz, n) => marker(at(hz), MARK, n ? 1 : 2, "solid"))],
    annotations: lines.map(([words, hz], n) => label(words, at(hz), n)),
    hovermode: "closest",
  });
}

export function marker(x, color = INK, width = 1, dash = "dot") {
  return { type: "line", x0: x, x1: x, yref: "paper", y0: 0, y1: 1, line: { color, width, dash } };
}

/** One below the other: on a narrow screen they would lie on each other. */
export const label = (text, x, n) => ({ x, y: n ? 0.9 : 1, yref: "paper", xanchor: "left", yanchor: "top", text, showarrow: false });

/** When, at what speed and load, and what the spectrum stands on. */
export function momentCaption({ spectra, index }) {
  const number = (value, decimals, unit) => (value === null ? null : `${formatFixed(value, decimals)} ${unit}`);
  const facts = [
    number(spectra.speed_rpm[index], 2, "r/min"),
    number(spectra.power_mw[index], 1, "MW"),
    spectra.operating_state[index] === "unknown" ? null : stateWords(spectra.operating_state[index]),
    `average of ${formatFixed(spectra.duration_s[index], 0)} s`,
  ];
  const level = { good: null, uncertain: "Uncertain", bad: "No 1× amplitude" }[spectra.level[index]];
  const doubt = level ? ` ${level}: ${reasonWords(spectra.reason[index])}.` : "";
  return `${formatTime(spectra.time[index] * 1000)}: ${facts.filter(Boolean).join(", ")}.${doubt}`;
}
