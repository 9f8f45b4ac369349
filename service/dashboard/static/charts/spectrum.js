/** Amplitude against frequency: shaft above, bearing below, 1× and vortex marked. */

import { amplitudeFactor, amplitudeUnit, shownAmplitude } from "../amplitudes.js";
import { formatFixed } from "../format.js";
import { label, marker } from "./moment_spectrum.js";
import { X_COLOUR, Y_COLOUR, axis, baseLayout, curve } from "./style.js";
import { SCALE_FROM_HZ } from "./waterfall_scale.js";

const CHANNELS = [
  ["shaft_x", "shaft x", X_COLOUR, "solid", "y"],
  ["shaft_y", "shaft y", Y_COLOUR, "dash", "y"],
  ["bearing_x", "bearing x", X_COLOUR, "solid", "y2"],
  ["bearing_y", "bearing y", Y_COLOUR, "dash", "y2"],
];

const LINE_WORDS = { order1: "1×", vortex: "vortex" };

const present = (spectrum) => CHANNELS.filter(([id]) => spectrum.channels[id]?.amplitude);

export function spectrumTraces(spectrum) {
  const { frequency_hz: hz, channels } = spectrum;
  return present(spectrum).map(([id, name, colour, dash, yaxis]) => curve(hz, channels[id].amplitude.map(shownAmplitude), {
    name: name.replace(/.* /, ""),
    legendgroup: name.replace(/.* /, ""),
    showlegend: yaxis === "y" || !present(spectrum).some(([other]) => other === id.replace("bearing", "shaft")),
    yaxis,
    line: { color: colour, width: 1.4, dash },
    hovertemplate: `${name}: %{y:.2f} ${amplitudeUnit()} at %{x:.3f} Hz<extra></extra>`,
  }));
}

export function spectrumLayout(spectrum, toHz) {
  const lines = Object.entries(spectrum.lines).filter(([, hz]) => hz !== null);
  const range = (ids) => [0, 1.15 * amplitudeFactor() * largest(spectrum, ids, toHz)];
  return baseLayout(`spectrum ${toHz}`, {
    grid: { rows: 2, columns: 1 },
    xaxis: axis("Frequency, Hz", { range: [0, toHz], anchor: "y2" }),
    yaxis: axis(`shaft, ${amplitudeUnit()}`, { domain: [0.54, 1], range: range(["shaft_x", "shaft_y"]) }),
    yaxis2: axis(`bearing, ${amplitudeUnit()}`, { domain: [0, 0.46], range: range(["bearing_x", "bearing_y"]) }),
    shapes: lines.map(([, hz]) => marker(hz)),
    annotations: lines.map(([name, hz]) => label(LINE_WORDS[name] ?? name, hz, 0)),
    hovermode: "closest",
    margin: { l: 56, r: 12, t: 8, b: 40 },
  });
}

function largest(spectrum, ids, toHz) {
  const seen = (hz) => hz >= SCALE_FROM_HZ && hz <= toHz;
  const amplitudes = ids.flatMap((id) => spectrum.channels[id]?.amplitude ?? []);
  const n = spectrum.frequency_hz.length;
  return amplitudes.reduce((most, um, index) => (seen(spectrum.frequency_hz[index % n]) ? Math.max(most, um) : most), 0.01);
}

export function spectrumCaption(spectrum) {
  const found = Object.entries(spectrum.lines).filter(([, hz]) => hz !== null);
  const marked = found.map(([name, hz]) => `${LINE_WORDS[name] ?? name} at ${formatFixed(hz, 4)} Hz`).join(", ");
  const absent = CHANNELS.filter(([id]) => !spectrum.channels[id]?.amplitude).map(([, name]) => name);
  const missing = absent.length ? ` Without ${absent.join(", ")}: not usable.` : "";
  return `${marked ? `Dotted: ${marked}.` : "No line found to mark."}${missing}`;
}

/** A sentence if not one channel can be drawn, else null. */
export function spectrumAbsence(spectrum) {
  return present(spectrum).length ? null : "No channel of this bearing has a usable spectrum.";
}
