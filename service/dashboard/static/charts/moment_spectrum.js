/** One spectrum of a waterfall, by itself. */

import { amplitudeUnit, shownAmplitude } from "../amplitudes.js";
import { stateWords } from "../film_words.js";
import { formatFixed, formatTime } from "../format.js";
import { reasonWords } from "../words.js";
import { INK, X_COLOUR, axis, baseLayout } from "./style.js";
import { DECADES } from "./waterfall_scale.js";

export function momentTraces({ row, abscissa, unit, name }) {
  return [
    {
      type: "scatter",
      mode: "lines",
      x: abscissa,
      y: row.amplitude.map(shownAmplitude),
      name,
      line: { color: X_COLOUR, width: 1.4 },
      hovertemplate: `%{y:.3~g} ${amplitudeUnit()} at %{x:.3f} ${unit}<extra></extra>`,
    },
  ];
}

/** `top` is the largest amplitude of all, so that one spectrum can be held against the next. */
export function momentLayout({ row, inOrders, toUpper, isLog, revision, top }) {
  const at = (hz) => (inOrders ? hz / row.order1Hz : hz);
  const lines = [["1×", row.order1Hz], ["vortex", row.vortexHz]].filter(([, hz]) => hz && row.order1Hz);
  const range = isLog ? [Math.log10(top) - DECADES, Math.log10(top) + 0.1] : [0, 1.1 * top];
  return baseLayout(revision, {
    xaxis: axis(inOrders ? "Multiple of the running speed" : "Frequency, Hz", { range: [0, toUpper] }),
    yaxis: axis(amplitudeUnit(), { type: isLog ? "log" : "linear", range }),
    shapes: lines.map(([, hz]) => marker(at(hz))),
    annotations: lines.map(([words, hz], n) => label(words, at(hz), n)),
    hovermode: "closest",
  });
}

const marker = (x) => ({ type: "line", x0: x, x1: x, yref: "paper", y0: 0, y1: 1, line: { color: INK, width: 1, dash: "dot" } });

/** One below the other: on a narrow screen they would lie on each other. */
const label = (text, x, n) => ({ x, y: n ? 0.9 : 1, yref: "paper", xanchor: "left", yanchor: "top", text, showarrow: false });

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
