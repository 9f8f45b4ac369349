/** Waveforms of every transducer of a bearing, one below the other, and of the key-phase. */

import { ask } from "../api.js";
import { formatTime } from "../format.js";
import { poll } from "../poll.js";
import { panel } from "./panel.js";
import { X_COLOUR, axis, baseLayout } from "./style.js";

const PERIOD_S = 5;
const SECONDS = "2";
const UNITS = { um: "µm", "m/s2": "m/s²" };

/** `absence()` says why there are none, null if there are. Returns `{ node, again(), close() }`. */
export function waveforms(unit, bearing, absence) {
  const box = panel("Waveforms, newest", "waveforms");
  let channels = null;
  const questions = poll(async (signal) => {
    if (absence() !== null) return box.explain(absence());
    channels ??= await channelsOf(unit, bearing, signal);
    const found = await ask(["units", unit, "waveform"], [["seconds", SECONDS], ...channels.map((id) => ["channel", id])], signal);
    const names = Object.keys(found.channels);
    await box.show(names.map((name, n) => traceOf(found, name, n)), layoutOf(found, names), `As sampled, from ${formatTime(Date.parse(found.time))} on.`);
  }, () => PERIOD_S, (failure) => box.fail(failure));
  return { node: box.node, again: questions.again, close: questions.stop };
}

async function channelsOf(unit, bearing, signal) {
  const { waveform } = await ask(["units", unit, "channels"], [], signal);
  return waveform.filter(({ used_by: uses }) => uses.some((use) => use === "key_phase" || use.startsWith(`${bearing} `))).map(({ settings }) => settings.id);
}

const axisName = (n) => (n ? `y${n + 1}` : "y");

function traceOf({ channels, rate_hz: rateHz }, name, n) {
  const { sample, unit } = channels[name];
  const hovertemplate = `${name}: %{y:.4~g} ${UNITS[unit] ?? unit} at %{x:.3f} s<extra></extra>`;
  return { type: "scatter", mode: "lines", name, x: sample.map((_, at) => at / rateHz), y: sample, yaxis: axisName(n), line: { color: X_COLOUR, width: 1.2 }, hovertemplate };
}

function layoutOf({ channels }, names) {
  const height = 1 / names.length;
  const domains = names.map((_, n) => [1 - (n + 1) * height, 1 - (n + 0.25) * height]);
  const axes = names.map((name, n) => [axisName(n).replace("y", "yaxis"), axis(UNITS[channels[name].unit] ?? channels[name].unit, { domain: domains[n] })]);
  const labels = names.map((text, n) => ({ text, x: 0, y: domains[n][1], xref: "paper", yref: "paper", xanchor: "left", yanchor: "bottom", showarrow: false }));
  return baseLayout("waveforms", { ...Object.fromEntries(axes), xaxis: axis("Time, s", { anchor: axisName(names.length - 1) }), annotations: labels, showlegend: false, hovermode: "closest" });
}
