/** The charts of a bearing and the questions they ask. */

import { ask } from "../api.js";
import { centreCaption, centreLayout, centreTraces, orbitLayout, orbitTraces } from "../charts/circle.js";
import { panel } from "../charts/panel.js";
import { spectrumAbsence, spectrumCaption, spectrumLayout, spectrumTraces } from "../charts/spectrum.js";
import { element } from "../dom.js";
import { formatFixed } from "../format.js";
import { choice } from "../parts/choice.js";
import { readingOf } from "../parts/reading.js";
import { poll } from "../poll.js";
import { orbitAddress, waterfallAddress } from "../route.js";
import { NOT_CURRENT, reasonSentence, reasonWords } from "../words.js";
import { centreTrail, trendPanels } from "./trend_panels.js";

const PERIOD_S = 5;
const ORBIT_S = 2;

/** Returns `{ node, draw(latest, unit, view), close() }`. */
export function bearingCharts(path) {
  const trends = trendPanels(path);
  const pictures = [orbitChart(path), centreChart(path, trends), spectrumChart(path)];
  const node = element("div", { class: "charts" }, ...trends.nodes, ...pictures.map((picture) => picture.node));
  return {
    node,
    draw(latest, unit, view) {
      const { reason } = readingOf(latest, "order1_frequency_hz");
      const notCurrent = NOT_CURRENT.has(reason) ? `${reasonWords(reason)}.` : null;
      trends.draw(latest, view, notCurrent);
      for (const picture of pictures) picture.draw(latest, notCurrent);
    },
    close() {
      for (const part of [trends, ...pictures]) part.close();
    },
  };
}

/**
 * Asks `path` again and again and hands a good answer to `show`; says why when there is none.
 *
 * Until the bearing has its first result there is nothing to ask for: `absence()` says so.
 */
function asking(box, path, show, absence = () => null, query = []) {
  return poll(async (signal) => {
    if (absence() === null) await show(await ask(path, query, signal));
    else box.explain(absence());
  }, () => PERIOD_S, (failure) => box.fail(failure));
}

function orbitChart(path) {
  const box = panel("Orbit", "orbit", element("a", { href: orbitAddress(path[1], path[3]) }, "Orbit player"));
  const show = (motion) => box.show(orbitTraces(motion), orbitLayout(motion), orbitCaption(motion));
  return resultChart(box, [...path, "motion"], show, [["seconds", ORBIT_S]]);
}

/** A chart that one question fills, asked as soon as the bearing has a result. */
function resultChart(box, path, show, query = []) {
  let latest = null;
  const questions = asking(box, path, show, () => absenceWords(latest), query);
  return {
    node: box.node,
    draw(newest, notCurrent) {
      const first = absenceWords(latest) !== null && absenceWords(newest) === null;
      latest = newest;
      if (first) questions.again();
      box.draw(newest.age_s, notCurrent);
    },
    close: questions.stop,
  };
}

function absenceWords(latest) {
  if (latest === null) return "Asking the service.";
  return latest.time === null ? `No result yet. ${reasonSentence(latest.quality.reason)}` : null;
}

function orbitCaption(motion) {
  return `Shaft relative to bearing, the last ${formatFixed(motion.n_samples / motion.rate_hz, 1)} s, mean removed. Cross: newest sample.`;
}

function spectrumChart(path) {
  let spectrum = null;
  const show = async () => {
    const absence = spectrumAbsence(spectrum);
    if (absence) box.explain(absence);
    else await box.show(spectrumTraces(spectrum), spectrumLayout(spectrum, span.value()), spectrumCaption(spectrum));
  };
  const spans = [[3, "0–3 Hz"], [25, "0–25 Hz"]];
  const span = choice("Range", spans, 3, () => spectrum && show());
  const overTime = element("a", { href: waterfallAddress(path[1], path[3]) }, "Spectra over time");
  const box = panel("Spectrum", "spectrum", overTime, span.node);
  return resultChart(box, [...path, "spectrum"], (answer) => {
    spectrum = answer;
    return show();
  });
}

/** Fed by the bearing's facts, the trends' trail and the newest reading. */
function centreChart(path, trends) {
  const box = panel("Shaft centre in the clearance circle", "centre");
  let facts = null;
  let drawn = null;
  const questions = asking(box, path, (answer) => {
    facts = answer;
    drawn = null; // draw afresh, and with it forget a trouble that is over
  });
  return {
    node: box.node,
    draw(latest, notCurrent) {
      box.draw(latest.age_s, notCurrent);
      if (facts === null) return;
      const current = centreNow(latest);
      const asked = trends.newest();
      const trail = centreTrail(asked);
      const inputs = JSON.stringify([current, trail, facts]);
      if (inputs === drawn) return;
      drawn = inputs;
      if (!current && trail.length === 0) {
        const now = `No shaft centre now: ${reasonWords(readingOf(latest, "shaft_centre_x_um").reason)}`;
        box.explain(asked ? `${now}; and none in the chosen span.` : `${now}.`);
        return;
      }
      const layout = centreLayout(facts.clearance_um, trail, current);
      const caption = centreCaption(facts, current);
      box.show(centreTraces(trail, current), layout, caption).catch((failure) => {
        drawn = null;
        box.trouble(failure.message);
      });
    },
    close: questions.stop,
  };
}

function centreNow(latest) {
  const [x, y] = ["shaft_centre_x_um", "shaft_centre_y_um"].map((name) => readingOf(latest, name).value);
  return x === null || y === null ? null : { x, y };
}
