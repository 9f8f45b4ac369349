/** Spectra of a bearing over time, and the one of a chosen moment. */

import { ask } from "../api.js";
import { changeWords, kindWords } from "../alarm_words.js";
import { fullTraces, momentCaption, momentLayout, momentTraces } from "../charts/moment_spectrum.js";
import { panel } from "../charts/panel.js";
import { AXES } from "../charts/spectrum_reading.js";
import { alarmTraces, lineTraces, mapTraces, markTraces, nLines, waterfallLayout } from "../charts/waterfall.js";
import { alongOrders, ordersOf, rowsOf } from "../charts/waterfall_rows.js";
import { SCALE_FROM_HZ, highest } from "../charts/waterfall_scale.js";
import { element } from "../dom.js";
import { formatTime } from "../format.js";
import { spectrumCursor } from "../parts/spectrum_cursor.js";
import { poll } from "../poll.js";
import { waterfallAddress } from "../route.js";
import { onTheme } from "../theme.js";
import { bearingHead } from "./bearing_head.js";
import { momentSlider } from "./waterfall_moment.js";
import { waterfallChoices } from "./waterfall_choices.js";

const MAX_SPECTRA = 240;
const MAX_ALARMS = 200;
const PERIOD_S = 30;
const LEAST_ROOM_S = 30;

/** Returns `{ draw(view), close() }`. */
export function waterfallPage(main, unit, bearing) {
  const path = ["units", unit, "bearings", bearing];
  const head = bearingHead(unit, bearing, ": spectra over time", waterfallAddress);
  const choices = waterfallChoices(() => questions.again(), redraw);
  const map = panel("Spectra over time", "waterfall");
  const single = panel("Spectrum of the moment", "moment");
  const full = panel("Full spectrum, newest", "full-spectrum");
  const panels = [map, single, full];
  const moment = momentSlider(redraw);
  const cursor = spectrumCursor(redraw);
  map.node.addEventListener("point", ({ detail }) => moment.choosePoint(detail));
  single.node.addEventListener("point", ({ detail }) => cursor.choosePoint(detail));
  const parts = [head, choices, map, moment, single, cursor, full].map(({ node }) => node);
  main.append(element("div", { class: "bearing waterfall-page" }, ...parts));
  let found = null;
  let view = null;

  const questions = poll(async (signal) => {
    if (view?.serviceTimeMs == null) return;
    const range = choices.range(view.serviceTimeMs);
    found = await askSpectra(path, choices.place(), range, signal);
    await show();
  }, () => PERIOD_S, tell);

  function tell(failure) {
    for (const box of panels) box.trouble(failure.message);
  }
  function redraw() {
    show().catch(tell);
  }

  async function show() {
    if (found === null) return;
    const absence = absenceWords(found, choices);
    moment.offer(found.spectra, absence === null);
    if (absence !== null) {
      cursor.node.hidden = true;
      for (const box of panels) box.explain(absence);
      return;
    }
    const drawn = drawnOf(found, choices);
    await showMap(map, drawn, found, moment);
    await showMoment(single, cursor, drawn, found.spectra, moment.index());
    await showFull(full, cursor, drawn, found);
  }

  const stopTheme = onTheme(redraw); // shades of a map are colours, not names of colours
  return {
    draw(now) {
      const first = view?.serviceTimeMs == null && now.serviceTimeMs !== null;
      view = now;
      head.draw(now);
      if (first) questions.again();
      for (const box of panels) box.draw(null, null);
    },
    close() {
      questions.stop();
      stopTheme();
    },
  };
}

async function askSpectra(path, place, { startMs, endMs }, signal) {
  const times = [["start", new Date(startMs).toISOString()], ["end", new Date(endMs).toISOString()]];
  const query = [...times, ["channel", place], ["max_spectra", String(MAX_SPECTRA)]];
  const spectra = await ask([...path, "spectra"], query, signal);
  const [, unit, , bearing] = path;
  const { events } = await ask(["alarms", "events"], [...times, ["unit", unit], ["limit", String(MAX_ALARMS)]], signal);
  const alarms = events
    .filter(({ subject, change }) => subject === bearing && ["raised", "escalated"].includes(change))
    .map(({ time, kind, change }) => ({ timeS: Date.parse(time) / 1000, words: `${kindWords(kind)} ${changeWords(change)}` }));
  const newest = spectra.time.length ? await ask([...path, "spectrum"], [], signal).catch(() => null) : null; // none since the start
  return { spectra, alarms, newest, place, startS: startMs / 1000, endS: endMs / 1000 };
}

/** What is drawn, with the choices put in. */
function drawnOf({ spectra, place, startS, endS }, choices) {
  const axis = AXES[choices.axis()];
  const inOrders = axis === AXES.orders;
  const plain = rowsOf(spectra, place);
  const frequencyHz = spectra.frequency_hz;
  const abscissa = inOrders ? ordersOf(plain, frequencyHz) : frequencyHz.map((hz) => axis.of(hz));
  const rows = inOrders ? alongOrders(plain, frequencyHz, abscissa) : plain;
  const turnHz = plain.map(({ order1Hz }) => order1Hz).filter(Boolean).at(-1) ?? null;
  const toUpper = Math.min(choices.toOrder() * axis.of(turnHz ?? Infinity, turnHz), abscissa.at(-1));
  const common = { rows, plain, frequencyHz, abscissa, axis, turnHz, toUpper, isLog: choices.isLog() };
  return { ...common, startS: shownFromS(startS, endS, Date.parse(spectra.first) / 1000), endS, headroom: choices.asLines(), revision: choices.revision() };
}

/** No stretch of time is shown that lies before the first spectrum of all, but for a little room. */
function shownFromS(startS, endS, firstS) {
  return Math.max(startS, firstS - Math.max(0.1 * (endS - firstS), LEAST_ROOM_S));
}

function absenceWords({ spectra, place }, choices) {
  const simulated = spectra.simulated_until && Date.parse(spectra.simulated_until);
  const past = simulated ? ` What is older than ${formatTime(simulated)} is simulated: readings without spectra.` : "";
  if (spectra.first === null) {
    return `No spectrum of this bearing is kept yet. The first is kept with its first result from samples.${past}`;
  }
  if (spectra.time.length === 0) {
    const first = formatTime(Date.parse(spectra.first));
    return `No spectrum is kept of this time. The oldest that is kept is of ${first}.${past}`;
  }
  if (!spectra.channels[place].amplitude.some(Boolean)) return "This channel was not usable at any time of this range.";
  if (choices.axis() === "orders" && !spectra.order1_hz.some(Boolean)) {
    return "The running speed was not known in this range: there are no multiples of it. Choose the axis in Hz.";
  }
  return null;
}

async function showMap(box, drawn, found, moment) {
  const { spectra, alarms } = found;
  const traces = [...(drawn.headroom ? lineTraces(drawn) : mapTraces(drawn)), ...markTraces(drawn), ...alarmTraces(alarms, drawn.toUpper)];
  await box.show(traces, waterfallLayout(drawn, spectra.time[moment.index()]), mapCaption(drawn, found));
}

function mapCaption(drawn, { spectra, alarms }) {
  const from = formatTime(spectra.time[0] * 1000);
  const n = drawn.headroom ? nLines(drawn.rows) : spectra.time.length;
  const thinned = spectra.n_found > n ? `${n} of ${spectra.n_found}` : String(n);
  const { n_other_resolution: nOther, damaged, simulated_until: simulated } = spectra;
  const sentences = [
    `${thinned} spectra from ${from} on, each of its moment.`,
    "Dotted: 1×; dashed: vortex. Empty: no samples, or the channel failed.",
    alarms.length ? "Triangles: alarms of this bearing." : "",
    nOther ? `${nOther} with other lines, from before the analysis was set up anew, are left out.` : "",
    damaged.length ? `${damaged.length} are damaged on the disk and left out.` : "",
    simulated ? `Readings before ${formatTime(Date.parse(simulated))} are simulated and have no spectra.` : "",
  ];
  return sentences.filter(Boolean).join(" ");
}

async function showMoment(box, cursor, drawn, spectra, index) {
  const row = drawn.plain[index];
  cursor.node.hidden = !drawn.rows[index]?.amplitude;
  if (cursor.node.hidden) {
    const why = row?.amplitude ? "the running speed was not known" : "it was not usable";
    box.explain(`No spectrum of this channel at ${formatTime(spectra.time[index] * 1000)}: ${why}.`);
    return;
  }
  const { frequencyHz, axis } = drawn;
  cursor.draw({ frequencyHz, amplitude: row.amplitude, order1Hz: row.order1Hz, axis, fromHz: SCALE_FROM_HZ });
  const layout = momentLayout({ ...drawn, row, top: highest(drawn) }, cursor.hz());
  await box.show(momentTraces({ ...drawn, row }), layout, momentCaption({ spectra, index }));
}

async function showFull(box, cursor, drawn, { newest, place }) {
  const pair = place.split("_")[0];
  const row = newest && { order1Hz: newest.lines.order1, vortexHz: newest.lines.vortex };
  if (!newest?.full[pair] || drawn.axis.of(1, row.order1Hz) === null) {
    box.explain("No full spectrum now: it needs both channels of the pair and, along multiples, the running speed.");
    return;
  }
  const caption = `${pair === "shaft" ? "Shaft" : "Bearing"} x and y together, up to ${formatTime(Date.parse(newest.time))}: right of zero with the rotation, left against it.`;
  const layout = momentLayout({ ...drawn, row, top: highest(drawn) }, cursor.hz(), true);
  await box.show(fullTraces(newest, pair, drawn.axis), layout, caption);
}
